"""Rows of ``results.csv`` -> the tables a reader sees; nothing here knows Markdown or HTML."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from pipeline.reporting.background import PairFacts, Training
from pipeline.reporting.contrasts import DRAW
from pipeline.reporting.paper import (
    ABLATIONS,
    BOUND,
    CONCAT,
    FLOORS,
    PRINTED,
    TIMING,
    VALUES,
    method_rank,
    place,
    scenario_rank,
    shown,
)
from pipeline.reporting.tables import METRICS, Row
from pipeline.settings.params import SHOWN, shown_scenario

SETTINGS = {"paper": "the paper's iteration counts", "official": "the authors' own settings"}
LEARNED_SETTINGS = {"official": "the authors' own number of updates"}
"""Its network may be a smaller one than theirs; the training says its size."""
NOT_BELOW_CONSTANT = "†"
NOT_BELOW_ICP = "‡"
MARKS = {
    NOT_BELOW_CONSTANT: "does not beat the constant pose in both ERROR(R) and ERROR(t)",
    NOT_BELOW_ICP: "does not beat ICP from the centroids in both ERROR(R) and ERROR(t)",
}
HEADINGS = {
    "rmse_r_deg": "RMSE(R)",
    "rmse_t": "RMSE(t)",
    "mae_r_deg": "MAE(R)",
    "mae_t": "MAE(t)",
    "error_r_deg": "ERROR(R)",
    "error_t": "ERROR(t)",
    "median_error_r_deg": "median ERROR(R)",
    "below_5_deg_percent": "below 5°",
    "recall_percent": "recall",
    "seconds": "time",
    "peak_memory_mib": "memory",
    "spread_over_draws_deg": "spread over draws",
}
SPREAD = "spread_over_draws_deg"
"""The one column that no row of ``results.csv`` has: made of those of the draws."""
NOISY = "modelnet40-gaussian_noise"
"""Where the methods were trained whose tests the ablation ``noise`` makes noisier."""
TRAINED = ("diffusion", "representation", "fusion")
"""Ablations that train anew for each setting; the others take the weights of the main table."""
Budgets = Mapping[tuple[str, str, str | None], Training]
"""By scenario, method and ablated setting."""
Key = tuple[str, str, str, str]
"""Table, scenario, what is ablated (or nothing), subset: what one table holds."""


@dataclass(frozen=True)
class Line:
    """One method under one setting."""

    method: str
    setting: str
    cells: Mapping[str, Row]
    """By metric."""
    marks: str = ""
    note: int = 0
    """Number of its footnote, from 1."""

    @property
    def name(self) -> str:
        """The method as the reader knows it."""
        return shown(self.method).name

    @property
    def is_floor(self) -> bool:
        """Whether it learns nothing and is there to be beaten."""
        return shown(self.method).kind == "floor"

    @property
    def failures(self) -> int:
        """Pairs on which the method failed; each is scored as the identity pose."""
        return next(iter(self.cells.values())).failures


@dataclass(frozen=True)
class Table:
    """One table for the eye, floors on top."""

    key: Key
    title: str
    metrics: tuple[str, ...]
    lines: tuple[Line, ...]
    notes: tuple[str, ...]
    absent: tuple[str, ...]
    """Floors, and methods the paper has a row for, that these results lack."""

    @property
    def pairs(self) -> int:
        """Test pairs behind each number."""
        return next(iter(self.lines[0].cells.values())).pairs


def make_tables(
    rows: Sequence[Row], trainings: Iterable[Training], facts: Mapping[str, PairFacts]
) -> list[Table]:
    """Lay rows out as the paper's tables, then the extra ones; every table has the floors."""
    budgets = {
        (one.scenario, one.method, setting): one
        for one in trainings
        for setting in one.settings or [None]
    }
    grouped = _group(rows)
    return [
        _table(key, grouped, budgets, facts[key[1]])
        for key in sorted(grouped, key=_table_rank)
        if any(row.kind == "line" for row in grouped[key])
    ]


def _table(key: Key, grouped: Mapping[Key, list[Row]], budgets: Budgets, facts: PairFacts) -> Table:
    table, scenario, ablated, subset = key
    lines = _lines(grouped[key])
    main = _lines(grouped.get((place(scenario).table, scenario, "", subset), []))
    own = {line.method for line in lines}
    floors = [line for line in main if line.is_floor and line.method not in own]
    lines = sorted((*floors, *lines), key=lambda line: not line.is_floor)  # a stable order
    floors = [line for line in lines if line.is_floor]
    notes = [_note(line, key, budgets, facts) for line in lines]
    unique = tuple(dict.fromkeys(notes))
    return Table(
        key=key,
        title=_title(table, scenario, ablated),
        metrics=tuple(
            metric
            for metric in (*METRICS, SPREAD)
            if any(metric in line.cells for line in lines if line.method in own)
        ),
        lines=tuple(
            _finished(line, floors, unique.index(note) + 1)
            for line, note in zip(lines, notes, strict=True)
        ),
        notes=unique,
        absent=_absent(key, lines),
    )


def _group(rows: Iterable[Row]) -> dict[Key, list[Row]]:
    grouped: dict[Key, list[Row]] = {}
    for row in rows:
        if row.kind in ("line", "draw"):
            ablated = row.setting.partition("=")[0] if "=" in row.setting else ""
            grouped.setdefault((row.table, row.scenario, ablated, row.subset), []).append(row)
    return grouped


def _lines(rows: Sequence[Row]) -> list[Line]:
    cells: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        if row.kind == "line":
            cells.setdefault((row.method, row.setting), {})[row.metric] = row
    for (_, setting), line in cells.items():
        means = [
            row
            for row in rows
            if (row.method, row.metric) == (line["error_r_deg"].method, "error_r_deg")
            and row.setting.partition(DRAW)[0] == setting
        ]
        if len(means) > 1:
            line[SPREAD] = spread(means)
    ordered = sorted(cells, key=_line_rank)
    return [Line(method, setting, cells[method, setting]) for method, setting in ordered]


def spread(draws: Sequence[Row]) -> Row:
    """Give the standard deviation of a mean error over draws of the noise.

    Its interval is that of a standard deviation of normal values (chi-square), at 95 %.
    """
    freedom = len(draws) - 1
    value = float(np.std([row.value for row in draws], ddof=1))
    low, high = value * np.sqrt(freedom / (2 * gammaincinv(freedom / 2, [0.975, 0.025])))
    first = min(draws, key=lambda row: len(row.setting))
    return replace(first, metric=SPREAD, value=value, low=float(low), high=float(high), paper=None)


def _line_rank(key: tuple[str, str]) -> tuple[object, ...]:
    """Sort lines by method, then setting; Table 3 has it the other way, as in the paper."""
    method, setting = key
    by_setting, by_method = setting_rank(setting), method_rank(method)
    return (by_setting, by_method) if setting.startswith("diffusion=") else (by_method, by_setting)


def setting_rank(setting: str) -> tuple[list[int], list[tuple[float, str]]]:
    """Sort key that puts an ablation's settings in the order of the paper's rows."""
    varied = dict(part.partition("=")[::2] for part in setting.split(","))
    ranks = [
        [*values, varied.get(name)].index(varied.get(name)) if name in varied else 0
        for name, values in VALUES.items()
    ]
    return ranks, natural(setting)


def _finished(line: Line, floors: Sequence[Line], note: int) -> Line:
    """Add the marks and the footnote; a floor is not marked."""
    if line.is_floor:
        return Line(line.method, line.setting, line.cells, "", note)
    marks = {"constant": NOT_BELOW_CONSTANT, "icp_centroid": NOT_BELOW_ICP}
    same_setting_last = sorted(floors, key=lambda floor: floor.setting == line.setting)
    beside = {floor.method: floor for floor in same_setting_last}
    earned = "".join(
        mark
        for method, mark in marks.items()
        if method in beside and not beats(line, beside[method])
    )
    return Line(line.method, line.setting, line.cells, earned, note)


def beats(line: Line, floor: Line) -> bool:
    """Tell whether a method's mean errors are both smaller than a floor's; a tie is no win."""
    return all(
        line.cells[metric].value < floor.cells[metric].value
        for metric in ("error_r_deg", "error_t")
        if metric in line.cells  # a line that was only timed has none
    )


def natural(text: str) -> list[tuple[float, str]]:
    """Sort key in which ``steps=16`` follows ``steps=8``, and ``noise=0.1`` ``noise=0.02``."""
    parts = re.split(r"(\d+(?:\.\d+)?)", text)
    return [(float(part), "") if part[:1].isdigit() else (-1, part) for part in parts]


def _table_rank(key: Key) -> tuple[str, tuple[int, str], str, str]:
    table, scenario, ablated, subset = key
    return (table, scenario_rank(scenario), ablated, subset)


def _title(table: str, scenario: str, ablated: str) -> str:
    numbered = "Beyond the paper" if table == "extra" else f"Table {table}"
    if ablated in ABLATIONS or table == TIMING.table:
        what = ABLATIONS.get(ablated, TIMING).title
        return f"{numbered}: {what} ({place(scenario).title})"
    aside = f" ({ablated})" if ablated else ""
    return f"{numbered}: {place(scenario).title}{aside}"


def _absent(key: Key, lines: Sequence[Line]) -> tuple[str, ...]:
    """Name what the paper has a row for and these results lack: methods, or ablated settings."""
    table, scenario, ablated, _ = key
    printed = {(n.method, n.setting) for n in PRINTED if (n.table, n.scenario) == (table, scenario)}
    methods = {*FLOORS, *(method for method, _ in printed if not ablated)}
    missing = sorted(methods - {line.method for line in lines}, key=method_rank)
    settings = (printed if ablated else set()) - {(line.method, line.setting) for line in lines}
    return (
        *(shown(method).name for method in missing),
        *(
            f"{shown(method).name}, {setting}"
            for method, setting in sorted(settings, key=_line_rank)
        ),
    )


def _note(line: Line, key: Key, budgets: Budgets, facts: PairFacts) -> str:
    setting = SETTINGS.get(line.setting, line.setting)
    if shown(line.method).kind != "learned":
        training = "nothing trained"
    else:
        setting = LEARNED_SETTINGS.get(line.setting, setting)
        budget = _budget(line, key, budgets)
        training = describe_budget(budget) if budget else "training budget not recorded"
    named = "" if "=" in setting else f"Setting: {setting}. "  # the line names an ablated one
    said = f"{named}Data: {facts.source}. Training: {training}."
    if "seconds" in line.cells and key[0] == TIMING.table:
        timed = line.cells["seconds"].pairs
        said += f" Time and memory: of {timed} pairs, one at a time, the first call left out."
        if line.cells["seconds"].paper == BOUND:
            said += f" The paper prints its time as below {BOUND} s."
    if key[2] == "noise" and "=" not in line.setting:
        said += " Tested without added noise."
    if (key[0], line.setting) == CONCAT:
        said += (
            " The paper prints no numbers for this row: it says that training does not converge."
        )
    return said


def _budget(line: Line, key: Key, budgets: Budgets) -> Training | None:
    """Find the training behind a line: the ablation's own, or the one whose weights it took."""
    _, scenario, ablated, _ = key
    if ablated in TRAINED and "=" in line.setting:
        return budgets.get((scenario, line.method, line.setting))
    return budgets.get((NOISY if ablated == "noise" else scenario, line.method, None))


def describe_budget(training: Training) -> str:
    """Say in words what a training cost."""
    words = {
        "epochs": "{:,} epochs",
        "steps": "{:,} steps",
        "batch_size": "batches of {:,}",
        "train_pairs": "{:,} pairs",
        "epoch_pairs": "{:,} of them an epoch",
        "parameters": "{:,} parameters",
        "best_epoch": "best epoch {:,}",
    }
    budget = dict(training.budget)
    if budget.get("epoch_pairs") == budget.get("train_pairs"):
        budget.pop("epoch_pairs", None)
    said = [text.format(budget[key]) for key, text in words.items() if key in budget]
    said = [text.removesuffix("s") if text.startswith("1 ") else text for text in said]
    return ", ".join(said) or "budget not recorded"


def banner(profile: str, facts: Iterable[PairFacts]) -> str | None:
    """Say what keeps these numbers from being a reproduction; None if nothing does."""
    recorded = {one.scenario: one.source in ("local", "download") for one in facts}
    made_up = sorted((name for name, real in recorded.items() if not real), key=scenario_rank)
    if profile == "paper" and not made_up:
        return None
    said = f"{profile} profile: not a reproduction"
    if not made_up:
        return said
    everything = len(made_up) == len(recorded)
    titles = "all of it" if everything else "; ".join(place(name).title for name in made_up)
    return f"{said} (synthetic data: {titles})"


def main_rows(rows: Iterable[Row], metric: str) -> dict[tuple[str, str], Row]:
    """Pick the headline row of each scenario and method: all pairs, the paper's setting.

    Where a method was not run with the paper's setting, its first other one stands in.
    """
    chosen: dict[tuple[str, str], Row] = {}
    for row in sorted(rows, key=lambda row: (row.setting != "paper", row.setting)):
        headline = row.kind == "line" and row.subset == "all" and "=" not in row.setting
        if headline and row.metric == metric and row.table == place(row.scenario).table:
            chosen.setdefault((row.scenario, row.method), row)
    return chosen


def summarise(rows: Iterable[Row]) -> dict[str, dict[str, float]]:
    """Pick the mean ERROR(R) [deg] of CF and CB on each scenario, to four digits."""
    summary: dict[str, dict[str, float]] = {name: {} for name in SHOWN.values()}
    for (scenario, method), row in main_rows(rows, "error_r_deg").items():
        if method in SHOWN:
            summary[SHOWN[method]][shown_scenario(scenario)] = float(f"{row.value:.4g}")
    return summary


def show(value: float) -> str:
    """Print a number as the paper does: four decimals, unless that would hide it."""
    if value == 0:
        return "0"
    return f"{value:.4f}" if abs(value) >= 5e-5 else f"{value:.0e}"


def show_bound(value: float) -> str:
    """Print one end of an interval: about three digits."""
    if value == 0:
        return "0"
    if abs(value) < 5e-4:
        return f"{value:.0e}"
    if abs(value) >= 1e5:
        return f"{value:.2e}"
    decimals = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2 if abs(value) >= 1 else 3
    return f"{value:.{decimals}f}"


def show_metric(metric: str, value: float) -> str:
    """Print a value of ``metric``: percentages with one decimal, the rest like the paper."""
    return f"{value:.1f}" if metric.endswith(("_percent", "_mib")) else show(value)


def unit_of(metric: str, length: str) -> str:
    """Name the unit of a metric; ``length`` is the cloud's own."""
    if metric.endswith("_percent"):
        return "%"
    if metric in ("seconds", "peak_memory_mib"):
        return {"seconds": "s", "peak_memory_mib": "MiB"}[metric]
    return "deg" if metric.endswith("_deg") else length
