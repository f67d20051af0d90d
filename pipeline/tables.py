"""Scores per pair -> the rows of ``results.csv``: one number a row, with its interval."""

import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, fields

import numpy as np
from jaxtyping import Float64, Int64

from pipeline.paper import ABLATIONS, Number, place, printed
from pipeline.result_files import EULER, SHIFT, Scores

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
)
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


def make_rows(scores: Iterable[Scores], *, seed: int) -> list[Row]:
    """Compute every metric of every method, sorted; every draw comes from ``seed``.

    All methods of a scenario are resampled alike, so that their intervals can be compared.
    """
    rows = (
        row
        for one in scores
        for subset, chosen in subsets(one).items()
        for row in _rows_of(one, subset, chosen, np.random.default_rng(seed))
    )
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


def _rows_of(
    scores: Scores,
    subset: str,
    chosen: Int64[np.ndarray, " chosen"],
    generator: np.random.Generator,
) -> Iterable[Row]:
    table = _table(scores)
    resamples = generator.integers(len(chosen), size=(RESAMPLES, len(chosen)))
    for metric, (contributions, statistic) in measure(scores).items():
        low, high = bootstrap_interval(contributions[chosen], statistic, resamples)
        number = Number(table, scores.scenario, scores.method, scores.setting, metric)
        yield Row(
            table=table,
            scenario=scores.scenario,
            subset=subset,
            method=scores.method,
            setting=scores.setting,
            metric=metric,
            value=_rounded(float(statistic(contributions[chosen]))),
            low=_rounded(low),
            high=_rounded(high),
            paper=printed(number) if subset == "all" else None,
            pairs=len(chosen),
            failures=int(scores.failed[chosen].sum()),
        )


def _table(scores: Scores) -> str:
    if scores.ablation is None:
        return place(scores.scenario).table
    return ABLATIONS[scores.ablation].table if scores.ablation in ABLATIONS else "extra"


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
        cells = asdict(row) | {"paper": "" if row.paper is None else repr(row.paper)}
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
