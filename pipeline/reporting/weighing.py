"""How a claim is weighed: the rule of the verdicts, and numbers as sentences give them."""

from collections.abc import Callable, Iterable, Sequence
from typing import Literal

from pipeline.reporting.contrasts import MINUS
from pipeline.reporting.paper import place, shown
from pipeline.reporting.tables import Row
from pipeline.reporting.views import main_rows, show_bound, unit_of

Verdict = Literal["confirmed", "not confirmed", "undecided", "not run"]
NO_DIFFERENCE_DEG = 0.5
"""A difference that stays within this, its whole interval included, counts as none."""
RULE = (
    "Each verdict follows one rule. Two methods, or two settings, answered the same pairs; the mean"
    " of their difference has a 95 % bootstrap interval over pairs. If that lies entirely on the"
    " claim's side, the claim is **confirmed**; entirely on the other side, **not confirmed**; else"
    " **undecided**. A claim over several comparisons is confirmed if all of them are on its side,"
    " and not confirmed if one is on the other; a claim that something holds somewhere, the other"
    " way round. Of two settings that both do not beat the mean training pose nothing is said:"
    " **undecided**. That two things do not differ is confirmed if the interval holds 0 and stays within"
    f" ±{NO_DIFFERENCE_DEG}°, not confirmed if it does not hold 0. Where a comparison is missing,"
    " the claim is **not run**. Errors are ERROR(R), in degrees; the paper's iteration counts are"
    " meant unless other settings are named."
)

ELSEWHERE = (
    "The paper's claims are weighed in the report on real data, `reports/real/results.md`; this one"
    " gives no verdicts."
)
"""Stands in a report without findings."""


class Numbers:
    """Rows by what they hold, over all pairs of a scenario."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self._rows = {
            (row.table, row.scenario, row.method, row.setting, row.metric): row
            for row in rows
            if row.subset == "all"
        }
        self._main = main_rows(self._rows.values(), "error_r_deg")

    def main(self, scenario: str, method: str) -> Row | None:
        """Give a method's mean ERROR(R) on a scenario, under its headline setting."""
        return self._main.get((scenario, method))

    def methods(self, scenario: str) -> list[str]:
        """Name the methods that were run on a scenario."""
        return [method for where, method in self._main if where == scenario]

    def official(self, scenario: str) -> list[Row]:
        """Give ERROR(R) of the methods that were also run with their authors' own settings."""
        return [
            row
            for (table, where, _, setting, metric), row in self._rows.items()
            if (table, where, setting) == (place(scenario).table, scenario, "official")
            and metric == "error_r_deg"
        ]

    def versus(
        self, scenario: str, mine: str, base: str, metric: str = "error_r_deg"
    ) -> Row | None:
        """Give the contrast of two methods' headline settings on a scenario."""
        one, other = self.main(scenario, mine), self.main(scenario, base)
        if one is None or other is None:
            return None
        setting = f"{one.setting}{MINUS}{base}:{other.setting}"
        return self.at(place(scenario).table, scenario, mine, setting, metric)

    def at(
        self, table: str, scenario: str, method: str, setting: str, metric: str = "error_r_deg"
    ) -> Row | None:
        """Give the row at a place, if there is one."""
        return self._rows.get((table, scenario, method, setting, metric))

    def settings(self, table: str, scenario: str, method: str, start: str) -> list[str]:
        """Name the settings that begin so; further draws and contrasts are left out."""
        return [
            row.setting
            for row in self._rows.values()
            if (row.table, row.scenario, row.method) == (table, scenario, method)
            and row.kind == "line"
            and row.metric == "error_r_deg"
            and row.setting.startswith(start)
        ]


def below(row: Row, bound: float = 0.0) -> bool:
    """Tell whether an interval lies entirely below a bound."""
    return row.high < bound


def above(row: Row, bound: float = 0.0) -> bool:
    """Tell whether an interval lies entirely above a bound."""
    return row.low > bound


def weigh(
    rows: Sequence[Row | None],
    claimed: Callable[[Row], bool],
    refuted: Callable[[Row], bool],
) -> Verdict:
    """Weigh a claim about every one of some comparisons; see ``RULE``."""
    found = [row for row in rows if row is not None]
    if any(map(refuted, found)):
        return "not confirmed"
    if not rows or len(found) < len(rows):
        return "not run"
    return "confirmed" if all(map(claimed, found)) else "undecided"


def weigh_some(
    rows: Sequence[Row], claimed: Callable[[Row], bool], refuted: Callable[[Row], bool]
) -> Verdict:
    """Weigh a claim that holds if one of some comparisons is on its side."""
    if not rows:
        return "not run"
    if any(map(claimed, rows)):
        return "confirmed"
    return "not confirmed" if all(map(refuted, rows)) else "undecided"


def weigh_same(rows: Sequence[Row | None]) -> Verdict:
    """Weigh the claim that nothing differs."""
    return weigh(
        rows,
        lambda row: max(-row.low, row.high) <= NO_DIFFERENCE_DEG,
        lambda row: above(row) or below(row),
    )


def say(row: Row, name: str | None = None) -> str:
    """Say a number with its unit and interval: ``FGR 2.1° [1.9, 2.4]``."""
    return f"{name or shown(row.method).name} {said(row)}"


def said(row: Row) -> str:
    """Give a number with its unit and interval; a contrast has its sign."""
    unit = {"deg": "°", "%": " %"}.get(unit_of(row.metric, ""), f" {unit_of(row.metric, '')}")
    sign = "+" if row.kind == "contrast" and not row.metric.endswith("_percent") else ""
    value, low, high = (
        f"{sign if number > 0 else ''}{show_bound(number)}"
        for number in (row.value, row.low, row.high)
    )
    return f"{value}{unit} [{low}, {high}]"


def base_name(contrast: Row) -> str:
    """Name the method that a contrast is held against."""
    base = contrast.setting.partition(MINUS)[2]
    return shown(base.partition(":")[0] if ":" in base else contrast.method).name


def listed(rows: Iterable[Row]) -> str:
    """Say contrasts one after the other, each under the name of what it is held against."""
    return ", ".join(say(row, base_name(row)) for row in sorted(rows, key=lambda row: row.value))
