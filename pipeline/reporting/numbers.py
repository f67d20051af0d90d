"""Answers per pair -> the numbers of ``results.csv``, each with its interval over pairs."""

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache

import numpy as np
import pandas as pd
from jaxtyping import Float64, Int64
from scipy.special import gammaincinv

from pcrdiff.geometry.metrics import CHAMFER_WITHIN
from pcrdiff.verdict import calibration_error, trust_quality
from pipeline.formats.answers import CHAMFER
from pipeline.reporting.contrasts import pick_contrasts
from pipeline.reporting.paper import (
    ACCURACY,
    ERRORS,
    MAE_AND_ERROR,
    PRINTED,
    PRINTED_AT,
    RIVALS,
    TIMING,
    UNSEEN_OBJECTS,
    VARIED,
    varied,
)
from pipeline.reporting.reading import EULER, SET, SHIFT, TIMED, choose

COLUMNS = ["table", "scenario", "subset", "method", "setting", "metric"]
COLUMNS += ["value", "low", "high", "paper", "pairs", "failures"]
"""Of ``results.csv``."""
METRICS = (*ACCURACY, "median_error_r_deg", "below_5_deg_percent")
BINNED = METRICS[4:]
"""Metrics of the pairs of one bin."""
CHAMFER_SUCCESS = "chamfer_success_percent"
"""Metric of a line whose answers all have a ``chamfer_ratio``."""
IMPROVEMENT = "improvement_percent"
"""Of a contrast: by how much of the other's mean ERROR(R) the first one's is smaller."""
SPREAD = "spread_over_draws_deg"
"""The one metric that ``results.csv`` does not hold: it is made from those of the draws."""
RIGHT, CALIBRATION = "right_percent", "calibration_error_percent"
TRUST = ("trusted_percent", "wrong_of_trusted_percent", "trusted_of_right_percent")
"""Of answers with a probability: how many are right, trusted, trusted but wrong, right and trusted."""
SYMMETRIC = ("bottle", "bowl", "cone", "cup", "flower_pot", "lamp", "tent", "vase")
"""Shapes whose rotation nobody can tell; ModelNet rows are also given without them."""
FEWEST = 5
"""Pairs in a bin; one with fewer has no rows."""
RESAMPLES = 1000
LINE = {
    "kind": "line", "subset": "all", "ablation": "", "draw": 0, "headline": False, "by": "",
    "bin_low": np.nan, "bin_high": np.nan, "base_method": "", "base_setting": "",
}  # fmt: skip
"""What a row says of itself where nothing else is said."""
Row = dict[str, object]
Values = Float64[np.ndarray, " pairs"]
Resamples = Int64[np.ndarray, "draws pairs"]
Statistic = Callable[[Float64[np.ndarray, "*batch pairs"]], Float64[np.ndarray, "*batch"]]


def make_numbers(
    answers: pd.DataFrame, times: pd.DataFrame, difficulty: pd.DataFrame, *, seed: int
) -> pd.DataFrame:
    """Compute every metric of every set of answers; all draws come from ``seed``.

    All methods of a scenario are resampled with the same draws, so that intervals can be compared.

    Args:
        answers: As :func:`pipeline.reporting.reading.read_answers` gives them.
        times: As ``read_times`` gives them, for Table 6; it repeats the accuracy of what was timed.
        difficulty: The bin of each pair, as ``measure_difficulty`` gives it.
        seed: Of the resampling.

    Returns:
        One number a row, in the order of ``results.csv`` and with its columns, of which ``low`` and
        ``high`` bound the 95 % bootstrap interval. Beside them ``kind`` (``line`` of a table,
        further ``draw`` of one, ``bin`` of pairs, ``trust``, ``contrast``), ``ablation``, ``headline``,
        ``draw``; of a bin ``by``, ``bin_low`` and ``bin_high``; of a contrast ``base_method`` and
        ``base_setting``; what an ablation's setting varies (``VARIED``); and ``written``, what
        ``results.csv`` has for a setting.
    """
    answers = with_contributions(answers)
    lines = pd.DataFrame([*_lines(answers, seed)])
    rows = [*_timed(times, lines, seed), *_bins(answers, difficulty, seed)]
    rows += [*_trust(answers, seed), *_contrasts(answers, times, seed)]
    numbers = pd.concat([lines, pd.DataFrame(rows, columns=lines.columns)], ignore_index=True)
    for name in ("value", "low", "high"):
        numbers[name] = [float(f"{number:.6g}") for number in numbers[name]]
    numbers = _with_paper(numbers).assign(written=numbers.apply(_written, axis=1))
    settings = pd.DataFrame([*map(varied, numbers["setting"])], numbers.index, VARIED)
    order = ["table", "scenario", "subset", "method", "written", "metric"]
    return numbers.join(settings).sort_values(order, ignore_index=True)


def write_numbers(numbers: pd.DataFrame) -> str:
    """Write numbers as the text of ``results.csv``: the same numbers, the same bytes."""
    rows = numbers.assign(setting=numbers["written"])[COLUMNS]
    text: str = rows.to_csv(index=False, lineterminator="\n")
    return text


def with_contributions(answers: pd.DataFrame) -> pd.DataFrame:
    """Add, for each metric of a line and of ``TRUST``, what a pair contributes to it."""
    euler, shift = answers[EULER].to_numpy(), answers[SHIFT].to_numpy()
    judged = answers["trusted"].astype(float) + 2 * answers["right"]
    return answers.assign(
        rmse_r_deg=(euler**2).mean(axis=-1),
        rmse_t=(shift**2).mean(axis=-1),
        mae_r_deg=np.abs(euler).mean(axis=-1),
        mae_t=np.abs(shift).mean(axis=-1),
        median_error_r_deg=answers["error_r_deg"],
        below_5_deg_percent=100.0 * (answers["error_r_deg"] < 5),
        chamfer_success_percent=100.0 * (answers[CHAMFER] <= CHAMFER_WITHIN),
        right_percent=100.0 * answers["right"],
        **dict.fromkeys(TRUST, judged),
    )


def statistic_of(metric: str) -> Statistic:
    """Say how what pairs contribute becomes the number: a mean, its root, the median, a share."""
    if metric.startswith("rmse"):
        return lambda values: np.asarray(np.sqrt(values.mean(axis=-1)))
    if metric.startswith("median"):
        return lambda values: np.asarray(np.median(values, axis=-1))
    if metric in TRUST:
        field = TRUST.index(metric)
        return lambda values: 100 * trust_quality(values % 2 == 1, values >= 2)[field]
    return lambda values: np.asarray(values.mean(axis=-1))


def bootstrap_interval(
    values: Values, statistic: Statistic, resamples: Resamples
) -> tuple[float, float]:
    """Bound a statistic by the 2.5 and 97.5 percentiles over resampled pairs."""
    low, high = np.percentile(statistic(values[resamples]), [2.5, 97.5])
    return float(low), float(high)


@lru_cache(maxsize=4)
def _resamples(pairs: int, seed: int) -> Resamples:
    return np.random.default_rng(seed).integers(pairs, size=(RESAMPLES, pairs))


def _measure(pairs: pd.DataFrame, metrics: Sequence[str], seed: int, place: Row) -> Iterator[Row]:
    """Give a row for each metric of some pairs; ``place`` says where they stand."""
    resamples = _resamples(len(pairs), seed)
    counts = {"pairs": len(pairs), "failures": int(pairs["failed"].sum())}
    for metric in metrics:
        values, statistic = pairs[metric].to_numpy(), statistic_of(metric)
        low, high = bootstrap_interval(values, statistic, resamples)
        found = {"metric": metric, "value": float(statistic(values)), "low": low, "high": high}
        yield LINE | place | found | counts


def _lines(answers: pd.DataFrame, seed: int) -> Iterator[Row]:
    for keys, pairs in answers.groupby([*SET, "headline"]):
        place = dict(zip([*SET, "headline"], keys, strict=True))
        if place["draw"]:
            yield from _measure(pairs, ERRORS, seed, place | {"kind": "draw"})
            continue
        metrics = [*METRICS, *([CHAMFER_SUCCESS] if pairs[CHAMFER].notna().all() else [])]
        yield from _measure(pairs, metrics, seed, place)
        if place["scenario"].startswith("modelnet40"):
            asymmetric = pairs[~pairs["group"].isin(SYMMETRIC)]
            if len(asymmetric):
                yield from _measure(asymmetric, metrics, seed, place | {"subset": "asymmetric"})


def _timed(times: pd.DataFrame, lines: pd.DataFrame, seed: int) -> Iterator[Row]:
    """Make the lines of Table 6: the times, and the accuracy of the same lines in Table 1 (a)."""
    main = lines[lines["metric"].isin(MAE_AND_ERROR)]
    main = choose(main, scenario=UNSEEN_OBJECTS, subset="all", ablation="")
    for keys, pairs in times.groupby(SET):
        place = dict(zip(SET, keys, strict=True))
        accuracy = choose(main, method=place["method"], setting=place["setting"])
        accuracy = accuracy.assign(table=TIMING.table, headline=False)
        yield from accuracy.to_dict("records")
        failures = int(accuracy["failures"].max()) if len(accuracy) else 0
        for row in _measure(pairs, TIMED, seed, place):
            yield row | {"failures": failures}


def _bins(answers: pd.DataFrame, difficulty: pd.DataFrame, seed: int) -> Iterator[Row]:
    binned = answers[answers["headline"]].merge(difficulty, on=["scenario", "pair"])
    names = ["scenario", "method", "by", "bin_low", "bin_high"]
    for keys, pairs in binned.groupby(names):
        place = dict(zip(names, keys, strict=True)) | {"kind": "bin", "table": "extra"}
        if len(pairs) >= FEWEST:
            yield from _measure(pairs, BINNED, seed, {**place, "setting": ""})


def _trust(answers: pd.DataFrame, seed: int) -> Iterator[Row]:
    """Say of the answers with a probability how true it is, and what becomes of those trusted.

    The calibration error has no interval: resampled pairs leave larger gaps than there are.
    """
    for keys, pairs in answers[answers["probability"].notna()].groupby([*SET, "headline"]):
        place = dict(zip([*SET, "headline"], keys, strict=True)) | {"kind": "trust"}
        yield from _measure(pairs, [RIGHT, *TRUST], seed, place)
        error = calibration_error(pairs["probability"].to_numpy(), pairs["right"].to_numpy())
        found: Row = {"metric": CALIBRATION, "value": 100 * error, "low": np.nan, "high": np.nan}
        yield LINE | place | found | {"pairs": len(pairs), "failures": 0}


def _contrasts(answers: pd.DataFrame, times: pd.DataFrame, seed: int) -> Iterator[Row]:
    """Give the mean of paired differences for each contrast, over the pairs that both have."""
    sets = dict(list(pd.concat([answers, times]).set_index("pair").groupby(SET)))
    for contrast in pick_contrasts(answers, times).to_dict("records"):
        mine, base = (
            sets[tuple(contrast[f"{name}{end}"] for name in SET)] for end in ("", "_base")
        )
        columns = ["failed", *contrast["metrics"]]
        both = mine[columns].merge(
            base[columns], left_index=True, right_index=True, suffixes=("", "_base")
        )
        if both.empty:
            continue
        both["failed"] |= both["failed_base"]
        place = {name: contrast[name] for name in SET} | {"kind": "contrast"}
        place |= {f"base_{name}": contrast[f"{name}_base"] for name in ("method", "setting")}
        difference = {name: both[name] - both[f"{name}_base"] for name in contrast["metrics"]}
        yield from _measure(both.assign(**difference), [*difference], seed, place)
        if contrast["headline"] and place["base_method"] in RIVALS[place["method"]]:
            yield from _improvement(both, seed, place)


def _improvement(both: pd.DataFrame, seed: int, place: Row) -> Iterator[Row]:
    """Give 100 (1 - mean of mine / mean of the other); nothing where the other errs nowhere."""
    if "error_r_deg" not in both:
        return
    errors = both[["error_r_deg", "error_r_deg_base"]].to_numpy()
    with np.errstate(divide="ignore", invalid="ignore"):
        mine, base = errors[_resamples(len(both), seed)].mean(axis=1).T
        drawn = 100 * (1 - mine / base)
        value = float(100 * (1 - np.divide(*errors.mean(axis=0))))
    if np.isfinite([value, *drawn]).all():
        low, high = np.percentile(drawn, [2.5, 97.5])
        counts = {"pairs": len(both), "failures": int(both["failed"].sum())}
        found: Row = {"metric": IMPROVEMENT, "value": value, "low": low, "high": high}
        yield LINE | place | found | counts


def _with_paper(numbers: pd.DataFrame) -> pd.DataFrame:
    """Put the paper's number beside ours; the authors' own settings stand beside the same one."""
    setting = numbers["setting"].replace("official", "paper")
    key = numbers.assign(setting=setting)[PRINTED_AT]
    paper = key.merge(PRINTED, how="left", on=PRINTED_AT)["paper"]
    own = numbers["kind"].isin(["line", "draw"]) & (numbers["draw"] == 0)
    return numbers.assign(paper=paper.where(own & (numbers["subset"] == "all")))


def _written(row: pd.Series) -> str:
    """Say a setting as ``results.csv`` does, with its draw, as a bin or as a contrast."""
    if row["kind"] == "bin":
        return f"{row['by']}={row['bin_low']:g}-{row['bin_high']:g}"
    if row["kind"] == "draw":
        return f"{row['setting']},draw={row['draw']}"
    if row["kind"] == "contrast":
        other = "" if row["base_method"] == row["method"] else f"{row['base_method']}:"
        return f"{row['setting']} minus {other}{row['base_setting']}"
    return str(row["setting"])


def spread_over_draws(numbers: pd.DataFrame) -> pd.DataFrame:
    """Give the standard deviation of each mean ERROR(R) over draws of the noise.

    Its interval is that of a standard deviation of normal values (chi-square), at 95 %.

    Returns:
        A row, with the columns of ``numbers``, for each line that was drawn more than once.
    """
    drawn = numbers[numbers["kind"].isin(["line", "draw"])].sort_values("draw", kind="stable")
    drawn = choose(drawn, subset="all", metric="error_r_deg")
    means = drawn.groupby(SET[:-1])["value"]
    lines = drawn.assign(value=means.transform("std"), freedom=means.transform("count") - 1)
    lines = lines[(lines["draw"] == 0) & (lines["freedom"] > 0)]
    for name, tail in (("low", 0.975), ("high", 0.025)):
        half = lines["freedom"] / 2
        lines[name] = lines["value"] * np.sqrt(half / gammaincinv(half, tail))
    return lines.assign(metric=SPREAD, paper=np.nan).drop(columns="freedom")
