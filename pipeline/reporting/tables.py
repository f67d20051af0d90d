"""The numbers -> the tables a reader sees; nothing here knows Markdown, LaTeX or HTML."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isnan

import pandas as pd

from pipeline.formats.weights import SHIPPED
from pipeline.reporting.paper import (
    ABLATIONS,
    BOUND,
    CONCAT,
    ERRORS,
    FLOORS,
    PRINTED,
    TIMING,
    method_rank,
    place,
    scenario_rank,
    setting_rank,
    shown,
    source_of,
)
from pipeline.reporting.reading import NOISE, STARTS, PairFile, Training, choose
from pipeline.reporting.showing import (
    HEADINGS,
    UNRESOLVED,
    describe_budget,
    show_bound,
    show_value,
    unit_of,
)
from pipeline.settings.variants import TRAINED

SETTINGS = {
    "paper": "the paper's iteration counts",
    "official": "the authors' own settings",
    "one_step": "one step of the walk",
    "four_steps": "four steps of the walk, each fed with the answer of the last",
    "refined_one_step": "several walks of one step, each refined by generalized ICP, the best fit kept",
    "refined": "several walks of four steps, each refined by generalized ICP, the best fit kept",
    "thorough": "64 starts, each refined by generalized ICP, the best fit kept",
}
LEARNED_SETTINGS = {"official": "the authors' own number of updates"}
"""Its network may be a smaller one than theirs; the training says its size."""
NOT_BELOW = {"constant": "†", "icp_centroid": "‡"}
"""By floor, the mark of a method that does not beat it."""
MARKS = {
    "†": "does not beat the constant pose in both ERROR(R) and ERROR(t)",
    "‡": "does not beat ICP from the centroids in both ERROR(R) and ERROR(t)",
}
TRAINED_ON_NOISE = "modelnet40-gaussian_noise"
"""Where the methods were trained whose tests the ablation ``noise`` makes noisier."""
KEY = ["table", "scenario", "ablation", "subset"]
"""What the numbers of one table have in common."""
SHOWN_BY_STARTS = ("below_5_deg_percent", "error_r_deg")
"""The metrics of the ablation of starts, each in a table of its own."""


@dataclass(frozen=True)
class Cell:
    """One number of a table, and how it is printed."""

    metric: str
    value: float
    low: float
    high: float
    paper: float
    """NaN where it prints none."""
    pairs: int

    @property
    def ours(self) -> str:
        """The number."""
        return show_value(self.metric, self.value)

    @property
    def theirs(self) -> str:
        """The paper's number, empty where it prints none."""
        return "" if isnan(self.paper) else show_value(self.metric, self.paper)

    @property
    def interval(self) -> tuple[str, str] | None:
        """The ends of its interval; None where there is none, or it says no more than the number."""
        if isnan(self.low):
            return None
        ends = show_bound(self.metric, self.low), show_bound(self.metric, self.high)
        return None if self.ours == UNRESOLVED and {*ends} <= {UNRESOLVED, "0"} else ends


@dataclass(frozen=True)
class Line:
    """One method under one setting."""

    method: str
    setting: str
    cells: Mapping[str, Cell]
    """By metric, or by number of starts."""
    failures: int
    """Pairs on which the method failed; each is scored as the identity pose."""
    marks: str = ""
    note: int = 0
    """Number of its footnote, from 1."""

    @property
    def name(self) -> str:
        """The method as the reader knows it."""
        return shown(self.method).name

    @property
    def aside(self) -> str:
        """The setting as it stands beside the name; empty for the paper's."""
        return "" if self.setting == "paper" else self.setting.replace(",", ", ").replace("_", " ")

    @property
    def pairs(self) -> int:
        """Test pairs behind each number."""
        return next(iter(self.cells.values())).pairs

    @property
    def is_floor(self) -> bool:
        """Whether it learns nothing and is there to be beaten."""
        return shown(self.method).kind == "floor"


@dataclass(frozen=True)
class Table:
    """One table for the eye, floors on top."""

    number: str
    scenario: str
    ablation: str
    """Empty for a main table."""
    subset: str
    unit: str
    """Of length."""
    metrics: tuple[str, ...]
    """The columns; numbers of starts where all are of ``metric``."""
    lines: tuple[Line, ...]
    notes: tuple[str, ...]
    absent: tuple[str, ...]
    """Floors, and methods the paper has a row for, that these results lack."""
    metric: str = ""
    """Of a table with a column for each number of starts."""

    @property
    def title(self) -> str:
        """What it is of."""
        numbered = "Beyond the paper" if self.number == "extra" else f"Table {self.number}"
        where = place(self.scenario).title
        if self.number == TIMING.table:
            return f"{numbered}: {TIMING.title} ({where})"
        if self.ablation in ABLATIONS:
            of = f", {HEADINGS[self.metric]}" if self.metric else ""
            return f"{numbered}: {ABLATIONS[self.ablation].title}{of} ({where})"
        return f"{numbered}: {where}{f' ({self.ablation})' if self.ablation else ''}"

    @property
    def anchor(self) -> str:
        """Where it stands on the page, beside its other subsets."""
        return "-".join(filter(None, (self.number, self.scenario, self.ablation, self.metric)))

    @property
    def label(self) -> str:
        """A name of its own, to refer to it by."""
        return f"{self.anchor}-{self.subset}"

    @property
    def pairs(self) -> int:
        """Test pairs behind each number."""
        return self.lines[0].pairs

    @property
    def is_main(self) -> bool:
        """Whether it holds the methods' numbers on all pairs of a scenario."""
        main = place(self.scenario).table == self.number
        return main and not self.ablation and self.subset == "all"

    @property
    def headlines(self) -> dict[str, Line]:
        """One line of each method: the paper's setting, where it was run."""
        found: dict[str, Line] = {}
        for line in sorted(self.lines, key=lambda line: line.setting != "paper"):
            found.setdefault(line.method, line)
        return {method: found[method] for method in sorted(found, key=method_rank)}

    def heads(self) -> list[tuple[str, str]]:
        """Name the columns of numbers and their units."""
        if self.metric:
            unit = unit_of(self.metric, self.unit)
            return [(f"{starts} start{'s' * (starts != '1')}", unit) for starts in self.metrics]
        return [(HEADINGS[metric], unit_of(metric, self.unit)) for metric in self.metrics]


def best(lines: Iterable[Line]) -> dict[str, float]:
    """Find the best value of each column among the methods that are not floors."""
    winners: dict[str, float] = {}
    cells = (item for line in lines if not line.is_floor for item in line.cells.items())
    for column, cell in cells:
        better = max if cell.metric.endswith("_percent") else min
        winners[column] = better(winners.get(column, cell.value), cell.value)
    return winners


def make_tables(
    numbers: pd.DataFrame, trainings: Iterable[Training], files: Mapping[str, PairFile]
) -> list[Table]:
    """Lay numbers out as the paper's tables, then the extra ones, then those by starts.

    Every table has the floors, but for the last: a floor starts nowhere.

    Args:
        numbers: As :func:`pipeline.reporting.numbers.make_numbers` gives them, and the spreads.
        trainings: For the footnotes.
        files: The pair file of each scenario.
    """
    budgets = {
        (one.scenario, one.method, setting): one
        for one in trainings
        for setting in one.settings or [""]
    }
    rows = choose(numbers, kind="line")
    by_starts = rows["ablation"] == STARTS
    lines = {keys: _lines(found) for keys, found in rows[~by_starts].groupby(KEY)}
    order = sorted(lines, key=lambda key: (key[0], scenario_rank(key[1]), *key[2:]))
    tables = [_table(key, lines, budgets, files[key[1]]) for key in order]
    return [*tables, *_tables_by_starts(rows[by_starts], budgets, files)]


def make_trust(numbers: pd.DataFrame) -> dict[str, list[Line]]:
    """Lay out, by scenario, how far the answers of each method that says so can be trusted."""
    rows = choose(numbers, kind="trust")
    lines = {scenario: _lines(found) for scenario, found in rows.groupby("scenario")}
    return {scenario: lines[scenario] for scenario in sorted(lines, key=scenario_rank)}


Key = tuple[str, str, str, str]
Budgets = Mapping[tuple[str, str, str], Training]
"""By scenario, method and ablated setting."""


def _lines(numbers: pd.DataFrame, column: str = "metric") -> list[Line]:
    """Make the lines of one table, in the order of the paper, with a cell for each ``column``."""
    fields = ["metric", "value", "low", "high", "paper", "pairs"]
    lines = []
    for (method, setting), rows in numbers.groupby(["method", "setting"]):
        cells = [Cell(*row) for row in rows[fields].itertuples(index=False)]
        columns = dict(zip(rows[column], cells, strict=True))
        lines.append(Line(method, setting, columns, rows["failures"].max()))
    return sorted(lines, key=lambda line: _line_rank((line.method, line.setting)))


def _line_rank(key: tuple[str, str]) -> tuple[object, ...]:
    """Sort lines by method, then setting; Table 3 has it the other way, as in the paper."""
    method, setting = key
    by_setting, by_method = setting_rank(setting), method_rank(method)
    return (by_setting, by_method) if setting.startswith("diffusion=") else (by_method, by_setting)


def _table(key: Key, lines: Mapping[Key, list[Line]], budgets: Budgets, file: PairFile) -> Table:
    _, scenario, _, subset = key
    own = {line.method for line in lines[key]}
    main = lines.get((place(scenario).table, scenario, "", subset), [])
    lent = [line for line in main if line.is_floor and line.method not in own]
    ordered = sorted((*lent, *lines[key]), key=lambda line: not line.is_floor)  # a stable order
    floors = [line for line in ordered if line.is_floor]
    notes = [_note(line, key, budgets, file) for line in ordered]
    unique = [*dict.fromkeys(notes)]
    return Table(
        *key,
        unit=file.unit,
        metrics=tuple(m for m in HEADINGS if any(m in line.cells for line in lines[key])),
        lines=tuple(
            replace(line, marks=_marks(line, floors), note=unique.index(note) + 1)
            for line, note in zip(ordered, notes, strict=True)
        ),
        notes=tuple(unique),
        absent=_absent(key, ordered),
    )


def _tables_by_starts(
    numbers: pd.DataFrame, budgets: Budgets, files: Mapping[str, PairFile]
) -> list[Table]:
    """Make, of each scenario, a table for each of ``SHOWN_BY_STARTS``: a line is a source of starts."""
    rows = numbers[numbers["metric"].isin(SHOWN_BY_STARTS)]
    rows = rows.assign(setting=[source_of(setting) for setting in rows["setting"]])
    tables = []
    for (table, scenario, ablation, subset, metric), found in rows.groupby([*KEY, "metric"]):
        lines, file = _lines(found, "starts"), files[scenario]
        key = table, scenario, ablation, subset
        notes = [_note(line, key, budgets, file) for line in lines]
        unique = [*dict.fromkeys(notes)]
        noted = (
            replace(line, note=unique.index(note) + 1)
            for line, note in zip(lines, notes, strict=True)
        )
        counts = tuple(sorted({*found["starts"]}, key=int))
        tables.append(Table(*key, file.unit, counts, (*noted,), (*unique,), (), metric))

    def rank(table: Table) -> tuple[object, ...]:
        return scenario_rank(table.scenario), SHOWN_BY_STARTS.index(table.metric), table.subset

    return sorted(tables, key=rank)


def _marks(line: Line, floors: Sequence[Line]) -> str:
    """Mark a method for each floor that it does not beat; a floor is not marked."""
    same_setting_last = sorted(floors, key=lambda floor: floor.setting == line.setting)
    beside = {floor.method: floor for floor in same_setting_last}
    return "".join(
        mark
        for method, mark in NOT_BELOW.items()
        if not line.is_floor and method in beside and not beats(line, beside[method])
    )


def beats(line: Line, floor: Line) -> bool:
    """Tell whether a method's mean errors are both smaller than a floor's; a tie is no win."""
    return all(
        line.cells[metric].value < floor.cells[metric].value
        for metric in ERRORS
        if metric in line.cells  # a line that was only timed has none
    )


def _absent(key: Key, lines: Sequence[Line]) -> tuple[str, ...]:
    """Name what the paper has a row for and these results lack: methods, or ablated settings."""
    table, scenario, ablation, _ = key
    here = choose(PRINTED, table=table, scenario=scenario)
    printed = {*here[["method", "setting"]].itertuples(index=False, name=None)}
    methods = {*FLOORS, *(method for method, _ in printed if not ablation)}
    missing = sorted(methods - {line.method for line in lines}, key=method_rank)
    settings = (printed if ablation else set()) - {(line.method, line.setting) for line in lines}
    ablated = [f"{shown(m).name}, {setting}" for m, setting in sorted(settings, key=_line_rank)]
    return (*(shown(method).name for method in missing), *ablated)


def _note(line: Line, key: Key, budgets: Budgets, file: PairFile) -> str:
    """Say of a line its setting, its data and its training, and what the paper says of it."""
    table, _, ablation, _ = key
    training, setting = "nothing trained", SETTINGS.get(own := _own(line.setting), own)
    if shown(line.method).kind == "learned":
        setting = LEARNED_SETTINGS.get(own, setting)
        budget = _budget(line, key, budgets)
        training = describe_budget(budget) if budget else "training budget not recorded"
        if budget and SHIPPED in budget.settings:
            source = budget.budget.get("data", {}).get("source", "unknown")
            training = f"weights that came with the code, from {source} data, {training}"
    varies = not setting or "=" in setting  # the line names it
    said = [*([] if varies else [f"Setting: {setting}."]), f"Data: {file.source}."]
    said.append(f"Training: {training}.")
    if table == TIMING.table and (seconds := line.cells.get("seconds")):
        said.append(
            f"Time and memory: of {seconds.pairs} pairs, one at a time, the first call left out."
        )
        if seconds.paper == BOUND:
            said.append(f"The paper prints its time as below {BOUND} s.")
    if ablation == NOISE and not varies:
        said.append("Tested without added noise.")
    if ablation == STARTS:
        said.append("Failures: the most with any number of starts.")
    if line.setting == CONCAT:
        said.append(
            "The paper prints no numbers for this row: it says that training does not converge."
        )
    return " ".join(said)


def _own(setting: str) -> str:
    """The setting itself, whether or not its weights came with the code."""
    return setting.removeprefix(SHIPPED).strip() or "paper" if _ships(setting) else setting


def _ships(setting: str) -> bool:
    return setting.partition(" ")[0] == SHIPPED


def _budget(line: Line, key: Key, budgets: Budgets) -> Training | None:
    """Find the training behind a line: the ablation's own, or the one whose weights it took."""
    _, scenario, ablation, _ = key
    if _ships(line.setting) or ablation == STARTS:
        return budgets.get((scenario, line.method, SHIPPED))
    if ablation in TRAINED and "=" in line.setting:
        return budgets.get((scenario, line.method, line.setting))
    return budgets.get((TRAINED_ON_NOISE if ablation == NOISE else scenario, line.method, ""))


def unbeaten(tables: Iterable[Table]) -> list[str]:
    """Name the scenarios in which no method beats ICP from the centroids."""
    mark = NOT_BELOW["icp_centroid"]
    return [
        place(table.scenario).title
        for table in tables
        if table.is_main and all(mark in line.marks for line in table.lines if not line.is_floor)
    ]
