"""Rows of ``results.csv`` -> the tables a reader sees; nothing here knows Markdown or HTML."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pipeline.background import PairFacts, Training
from pipeline.paper import (
    ABLATIONS,
    FLOORS,
    PRINTED,
    SCENARIOS,
    method_rank,
    place,
    scenario_rank,
    shown,
)
from pipeline.tables import METRICS, Row

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
}
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
    trained = {(one.scenario, one.method): one for one in trainings}
    grouped = _group(rows)
    tables = []
    for key in sorted(grouped, key=_table_rank):
        table, scenario, ablated, subset = key
        lines = _lines(grouped[key])
        main = _lines(grouped.get((place(scenario).table, scenario, "", subset), []))
        floors = [line for line in main if line.is_floor]
        rest = [line for line in lines if not line.is_floor]
        notes = [_note(line, trained, facts[scenario]) for line in (*floors, *rest)]
        unique = tuple(dict.fromkeys(notes))
        tables.append(
            Table(
                key=key,
                title=_title(table, scenario, ablated),
                metrics=tuple(m for m in METRICS if any(m in line.cells for line in lines)),
                lines=tuple(
                    _finished(line, floors, unique.index(note) + 1)
                    for line, note in zip((*floors, *rest), notes, strict=True)
                ),
                notes=unique,
                absent=_absent(table, scenario, (*floors, *rest)),
            )
        )
    return tables


def _group(rows: Iterable[Row]) -> dict[Key, list[Row]]:
    grouped: dict[Key, list[Row]] = {}
    for row in rows:
        ablated = row.setting.partition("=")[0] if "=" in row.setting else ""
        grouped.setdefault((row.table, row.scenario, ablated, row.subset), []).append(row)
    return grouped


def _lines(rows: Iterable[Row]) -> list[Line]:
    cells: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cells.setdefault((row.method, row.setting), {})[row.metric] = row
    ordered = sorted(cells, key=lambda key: (method_rank(key[0]), natural(key[1])))
    return [Line(method, setting, cells[method, setting]) for method, setting in ordered]


def _finished(line: Line, floors: Sequence[Line], note: int) -> Line:
    """Add the marks and the footnote; a floor is not marked."""
    if line.is_floor:
        return Line(line.method, line.setting, line.cells, "", note)
    marks = {"constant": NOT_BELOW_CONSTANT, "icp_centroid": NOT_BELOW_ICP}
    earned = "".join(
        marks[floor.method] for floor in floors if floor.method in marks and not beats(line, floor)
    )
    return Line(line.method, line.setting, line.cells, earned, note)


def beats(line: Line, floor: Line) -> bool:
    """Tell whether a method's mean errors are both smaller than a floor's; a tie is no win."""
    return all(
        line.cells[metric].value < floor.cells[metric].value
        for metric in ("error_r_deg", "error_t")
    )


def natural(text: str) -> list[tuple[int, str]]:
    """Sort key in which ``steps=16`` follows ``steps=8``."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]


def _table_rank(key: Key) -> tuple[str, tuple[int, str], str, str]:
    table, scenario, ablated, subset = key
    return (table, scenario_rank(scenario), ablated, subset)


def _title(table: str, scenario: str, ablated: str) -> str:
    place_of = {entry.table: entry for entry in ABLATIONS.values()}
    if table in place_of:
        return f"Table {table}: {place_of[table].title} ({place(scenario).title})"
    what = f" ({ablated})" if ablated else ""
    return f"{'Beyond the paper' if table == 'extra' else f'Table {table}'}: {place(scenario).title}{what}"


def _absent(table: str, scenario: str, lines: Iterable[Line]) -> tuple[str, ...]:
    printed = {n.method for n in PRINTED if (n.table, n.scenario) == (table, scenario)}
    missing = sorted({*FLOORS, *printed} - {line.method for line in lines}, key=method_rank)
    return tuple(shown(method).name for method in missing)


def _note(line: Line, trained: Mapping[tuple[str, str], Training], facts: PairFacts) -> str:
    budget = trained.get((facts.scenario, line.method))
    setting = SETTINGS.get(line.setting, line.setting)
    if shown(line.method).kind != "learned":
        training = "nothing trained"
    else:
        setting = LEARNED_SETTINGS.get(line.setting, setting)
        training = describe_budget(budget) if budget else "training budget not recorded"
    return f"Setting: {setting}. Data: {facts.source}. Training: {training}."


def describe_budget(training: Training) -> str:
    """Say in words what a training cost."""
    words = {
        "epochs": "{:,} epochs",
        "steps": "{:,} steps",
        "batch_size": "batches of {:,}",
        "train_pairs": "{:,} pairs",
        "parameters": "{:,} parameters",
        "best_epoch": "best epoch {:,}",
    }
    said = [
        text.format(training.budget[key]) for key, text in words.items() if key in training.budget
    ]
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
        headline = row.subset == "all" and row.metric == metric and "=" not in row.setting
        if headline and row.table == place(row.scenario).table:
            chosen.setdefault((row.scenario, row.method), row)
    return chosen


def summarise(rows: Sequence[Row], profile: str) -> dict[str, object]:
    """Pick the headlines: every method on the paper's first setting, CF and CB on all."""
    errors: dict[str, dict[str, float]] = {}
    for (scenario, method), row in main_rows(rows, "error_r_deg").items():
        if scenario == next(iter(SCENARIOS)) or method.startswith("pcrdiffusion_"):
            errors.setdefault(scenario, {})[method] = row.value
    return {"profile": profile, "error_r_deg": errors}


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
    decimals = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2 if abs(value) >= 1 else 3
    return f"{value:.{decimals}f}"


def show_metric(metric: str, value: float) -> str:
    """Print a value of ``metric``: percentages with one decimal, the rest like the paper."""
    return f"{value:.1f}" if metric.endswith("_percent") else show(value)


def unit_of(metric: str, length: str) -> str:
    """Name the unit of a metric; ``length`` is the cloud's own."""
    if metric.endswith("_percent"):
        return "%"
    if metric == "seconds":
        return "s"
    return "deg" if metric.endswith("_deg") else length
