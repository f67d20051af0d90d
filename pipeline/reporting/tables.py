"""Scores per pair -> the rows of ``results.csv``: one number a row, with its interval."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from pipeline.reporting.contrasts import DRAW, MINUS, Contrast, make_contrasts
from pipeline.reporting.difficulty import OVERLAP, ROTATION, Difficulty
from pipeline.reporting.paper import MAE_AND_ERROR, UNSEEN_OBJECTS, Number, printed
from pipeline.reporting.result_files import EULER, SHIFT, TIMED, Scores, Times, headlines

METRICS = (
    "rmse_r_deg",
    "rmse_t",
    "mae_r_deg",
    "mae_t",
    "error_r_deg",
    "error_t",
    "median_error_r_deg",
    "below_5_deg_percent",
    "recall_percent",
    "seconds",
    "peak_memory_mib",
)
IMPROVEMENT = "improvement_percent"
"""Of a contrast: by how much of the other's mean ERROR(R) the first one's is smaller."""
BINNED = ("error_r_deg", "error_t", "median_error_r_deg", "below_5_deg_percent")
DRAWN = ("error_r_deg", "error_t")
"""Metrics of the pairs of one bin, and of a further draw of the noise."""
SYMMETRIC = ("bottle", "bowl", "cone", "cup", "flower_pot", "lamp", "tent", "vase")
"""Shapes whose rotation nobody can tell; ModelNet rows are also given without them."""
RESAMPLES = 1000
SIGNIFICANT_DIGITS = 6
Statistic = Callable[[Float64[np.ndarray, "*batch pairs"]], Float64[np.ndarray, "*batch"]]


@dataclass(frozen=True)
class Row:
    """One number a reader may trust. Its fields are the columns of ``results.csv``."""

    table: str
    scenario: str
    subset: str
    """``all``, or ``asymmetric`` for ModelNet shapes whose rotation can be told."""
    method: str
    setting: str
    metric: str
    value: float
    low: float
    high: float
    """``low`` and ``high`` bound the 95 % bootstrap interval over pairs."""
    paper: float | None
    """The paper's number, where it prints one."""
    pairs: int
    failures: int

    @property
    def kind(self) -> Literal["line", "draw", "bin", "contrast"]:
        """Tell a line of a table from a further draw of one, a bin of pairs, and a contrast."""
        if MINUS in self.setting:
            return "contrast"
        if DRAW in self.setting:
            return "draw"
        return "bin" if self.setting.startswith((f"{ROTATION}=", f"{OVERLAP}=")) else "line"


def make_rows(
    scores: Sequence[Scores],
    times: Sequence[Times] = (),
    difficulties: Iterable[Difficulty] = (),
    *,
    seed: int,
) -> list[Row]:
    """Compute every metric of every method, sorted; every draw comes from ``seed``.

    All methods of a scenario are resampled alike, so that their intervals can be compared.

    Args:
        scores: Lines of the tables, and what bins and contrasts are made of.
        times: For Table 6; it repeats the accuracy of what was timed.
        difficulties: What the pairs of a scenario are sorted into bins by.
        seed: Of the resampling.
    """
    rows = [
        *(row for one in scores for row in _rows_of(one, seed)),
        *(row for one in times for row in _timed(one, scores, seed)),
        *(row for one in difficulties for row in _binned(one, scores, seed)),
        *(row for one in make_contrasts(scores, times) for row in _contrasted(one, seed)),
    ]
    return sorted(rows, key=key)


def key(row: Row) -> tuple[str, str, str, str, str, str]:
    """Say which number a row holds; rows are written in this order."""
    return (row.table, row.scenario, row.subset, row.method, row.setting, row.metric)


def subsets(scores: Scores) -> dict[str, Int64[np.ndarray, " chosen"]]:
    """Name the subsets of the pairs that are given a row, and the indices in each."""
    everything = np.arange(len(scores.pair))
    if not scores.scenario.startswith("modelnet40"):
        return {"all": everything}
    asymmetric = np.array([group not in SYMMETRIC for group in scores.group])
    chosen = {"all": everything, "asymmetric": everything[asymmetric]}
    return {name: indices for name, indices in chosen.items() if len(indices)}


def measure(
    scores: Scores,
) -> dict[str, tuple[Float64[np.ndarray, " pairs"], Statistic]]:
    """For each metric: what a pair contributes, and how contributions become the number."""
    error_r = scores.numbers["error_r_deg"]
    euler, shift = scores.columns(EULER), scores.columns(SHIFT)
    measured: dict[str, tuple[Float64[np.ndarray, " pairs"], Statistic]] = {
        "rmse_r_deg": ((euler**2).mean(axis=-1), _root_mean),
        "rmse_t": ((shift**2).mean(axis=-1), _root_mean),
        "mae_r_deg": (np.abs(euler).mean(axis=-1), _mean),
        "mae_t": (np.abs(shift).mean(axis=-1), _mean),
        "error_r_deg": (error_r, _mean),
        "error_t": (scores.numbers["error_t"], _mean),
        "median_error_r_deg": (error_r, _median),
        "below_5_deg_percent": (100.0 * (error_r < 5), _mean),
    }
    if "recall" in scores.numbers:
        measured["recall_percent"] = (100 * scores.numbers["recall"], _mean)
    if "seconds" in scores.numbers:
        measured["seconds"] = (scores.numbers["seconds"], _mean)
    return measured


def bootstrap_interval(
    contributions: Float64[np.ndarray, " pairs"],
    statistic: Statistic,
    resamples: Int64[np.ndarray, "draws pairs"],
) -> tuple[float, float]:
    """Bound a statistic by the 2.5 and 97.5 percentiles over resampled pairs."""
    low, high = np.percentile(statistic(contributions[resamples]), [2.5, 97.5])
    return float(low), float(high)


@dataclass(frozen=True)
class _Place:
    """Where rows stand: all of their columns that are no numbers, but the metric."""

    table: str
    scenario: str
    subset: str
    method: str
    setting: str

    def row(
        self,
        metric: str,
        numbers: tuple[float, float, float],
        pairs: int,
        failures: int,
    ) -> Row:
        value, low, high = map(_rounded, numbers)
        number = Number(self.table, self.scenario, self.method, self.setting, metric)
        paper = printed(number) if self.subset == "all" else None
        return Row(**vars(self), metric=metric, value=value, low=low, high=high,
                   paper=paper, pairs=pairs, failures=failures)  # fmt: skip


def _rows_of(scores: Scores, seed: int) -> Iterator[Row]:
    further = DRAW in scores.setting
    for subset, chosen in subsets(scores).items():
        at = _Place(scores.table, scores.scenario, subset, scores.method, scores.setting)
        if not further or subset == "all":
            yield from _measured(at, scores, chosen, DRAWN if further else METRICS, seed)


def _measured(
    at: _Place,
    scores: Scores,
    chosen: Int64[np.ndarray, " chosen"],
    metrics: Sequence[str],
    seed: int,
) -> Iterator[Row]:
    resamples = _resamples(len(chosen), seed)
    failures = int(scores.failed[chosen].sum())
    for metric, (contributions, statistic) in measure(scores).items():
        if metric in metrics:
            numbers = _with_interval(contributions[chosen], statistic, resamples)
            yield at.row(metric, numbers, len(chosen), failures)


def _timed(times: Times, scores: Iterable[Scores], seed: int) -> Iterator[Row]:
    """Make a line of Table 6: the times, and the accuracy that Table 1 (a) gives the same line."""
    at = _Place(times.table, times.scenario, "all", times.method, times.setting)
    resamples = _resamples(len(times.pair), seed)
    failures = 0
    for one in scores:
        here = (one.ablation, one.scenario, one.method, one.setting)
        if here == (None, UNSEEN_OBJECTS, times.method, times.setting):
            failures = int(one.failed.sum())
            yield from _measured(at, one, np.arange(len(one.pair)), MAE_AND_ERROR, seed)
    for metric in TIMED:
        numbers = _with_interval(times.numbers[metric], _mean, resamples)
        yield at.row(metric, numbers, len(times.pair), failures)


def _binned(difficulty: Difficulty, scores: Sequence[Scores], seed: int) -> Iterator[Row]:
    for (scenario, method), one in headlines(scores).items():
        if scenario == difficulty.scenario:
            for name, chosen in difficulty.bins(one.pair).items():
                at = _Place("extra", scenario, "all", method, name)
                yield from _measured(at, one, chosen, BINNED, seed)


def _contrasted(contrast: Contrast, seed: int) -> Iterator[Row]:
    mine = contrast.mine
    at = _Place(mine.table, mine.scenario, "all", mine.method, contrast.setting)
    failures = contrast.failures
    for metric in contrast.metrics:
        first, second = contrast.columns(metric)
        resamples = _resamples(len(first), seed)
        difference = _with_interval(first - second, _mean, resamples)
        yield at.row(metric, difference, len(first), failures)
        if metric == "error_r_deg" and contrast.is_rival:
            numbers = _improvement(first, second, resamples)
            if np.isfinite(numbers).all():
                yield at.row(IMPROVEMENT, numbers, len(first), failures)


@lru_cache(maxsize=4)
def _resamples(pairs: int, seed: int) -> Int64[np.ndarray, "draws pairs"]:
    return np.random.default_rng(seed).integers(pairs, size=(RESAMPLES, pairs))


def _with_interval(
    contributions: Float64[np.ndarray, " pairs"],
    statistic: Statistic,
    resamples: Int64[np.ndarray, "draws pairs"],
) -> tuple[float, float, float]:
    low, high = bootstrap_interval(contributions, statistic, resamples)
    return float(statistic(contributions)), low, high


def _improvement(
    mine: Float64[np.ndarray, " pairs"],
    base: Float64[np.ndarray, " pairs"],
    resamples: Int64[np.ndarray, "draws pairs"],
) -> tuple[float, float, float]:
    """Give 100 (1 - mean of mine / mean of the other); not finite where the other errs nowhere."""
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = 100 * (1 - _mean(mine[resamples]) / _mean(base[resamples]))
        value = float(100 * (1 - _mean(mine) / _mean(base)))
    if not np.isfinite(drawn).all():
        return np.nan, np.nan, np.nan
    low, high = np.percentile(drawn, [2.5, 97.5])
    return value, float(low), float(high)


def _mean(values: Float64[np.ndarray, "*batch pairs"]) -> Float64[np.ndarray, "*batch"]:
    return np.asarray(values.mean(axis=-1))


def _root_mean(values: Float64[np.ndarray, "*batch pairs"]) -> Float64[np.ndarray, "*batch"]:
    return np.asarray(np.sqrt(_mean(values)))


def _median(values: Float64[np.ndarray, "*batch pairs"]) -> Float64[np.ndarray, "*batch"]:
    return np.asarray(np.median(values, axis=-1))


def _rounded(value: float) -> float:
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}")


def format_rows(rows: Iterable[Row]) -> str:
    """Write rows as the text of ``results.csv``: the same rows, the same bytes."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Row)], lineterminator="\n")
    writer.writeheader()
    for row in rows:
        cells = vars(row) | {"paper": "" if row.paper is None else repr(row.paper)}
        writer.writerow({key: _cell(value) for key, value in cells.items()})
    return text.getvalue()


def _cell(value: object) -> str:
    return repr(value) if isinstance(value, float) else str(value)


def parse_rows(text: str) -> list[Row]:
    """Read the text of a ``results.csv``.

    Raises:
        ValueError: It has other columns.
    """
    reader = csv.DictReader(text.splitlines())
    wanted = [field.name for field in fields(Row)]
    if reader.fieldnames != wanted:
        raise ValueError(f"results.csv needs the columns {wanted}, has {reader.fieldnames}")
    return [
        Row(
            **{name: cells[name] for name in wanted[:6]},
            value=float(cells["value"]),
            low=float(cells["low"]),
            high=float(cells["high"]),
            paper=float(cells["paper"]) if cells["paper"] else None,
            pairs=int(cells["pairs"]),
            failures=int(cells["failures"]),
        )
        for cells in reader
    ]
