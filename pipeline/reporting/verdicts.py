"""How a claim is weighed: the rule of the verdicts, and numbers as sentences give them."""

from collections.abc import Callable, Iterable, Sequence
from typing import Literal, NamedTuple

import pandas as pd

from pipeline.reporting.paper import ABLATIONS, UNSEEN_OBJECTS, place, setting_rank, shown
from pipeline.reporting.showing import UNRESOLVED, show_bound, unit_of

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
    " **undecided**. That two things do not differ is confirmed if the interval holds 0 and stays"
    f" within ±{NO_DIFFERENCE_DEG}°, not confirmed if it does not hold 0. Where a comparison is"
    " missing, the claim is **not run**. Errors are ERROR(R), in degrees; the paper's iteration counts are"
    " meant unless other settings are named."
)


class Number(NamedTuple):
    """One number over all pairs of a scenario: a line of a table, a spread, or a contrast."""

    table: str
    scenario: str
    method: str
    setting: str
    base_method: str
    base_setting: str
    """Both empty unless it is a contrast."""
    metric: str
    value: float
    low: float
    high: float
    headline: bool


Base = tuple[str, str]
"""Method and setting that something is held against."""


class Numbers:
    """The numbers by what they are of; None stands for what was not run."""

    def __init__(self, numbers: pd.DataFrame) -> None:
        whole = numbers["kind"].isin(["line", "contrast"]) & (numbers["subset"] == "all")
        rows = numbers.loc[whole, [*Number._fields]].itertuples(index=False, name=None)
        self._rows = {row[:7]: row for row in map(Number._make, rows)}
        self._main = {
            (row.scenario, row.method): row
            for row in self._rows.values()
            if row.headline and row.metric == "error_r_deg"
        }

    def main(self, scenario: str, method: str) -> Number | None:
        """Give a method's mean ERROR(R) on a scenario, under its headline setting."""
        return self._main.get((scenario, method))

    def methods(self, scenario: str) -> list[str]:
        """Name the methods that were run on a scenario."""
        return [method for where, method in self._main if where == scenario]

    def versus(
        self, scenario: str, mine: str, base: str, metric: str = "error_r_deg"
    ) -> Number | None:
        """Give the contrast of two methods' headline settings on a scenario."""
        one, other = self.main(scenario, mine), self.main(scenario, base)
        if one is None or other is None:
            return None
        against = (base, other.setting)
        return self.at(place(scenario).table, scenario, mine, one.setting, metric, against)

    def ablated(
        self, ablation: str, method: str, setting: str, base: str | Base = ("", ""),
        metric: str = "error_r_deg",
    ) -> Number | None:  # fmt: skip
        """Give a number of a setting of an ablation, or its contrast with a base."""
        against = (method, base) if isinstance(base, str) else base
        table = ABLATIONS[ablation].table
        return self.at(table, UNSEEN_OBJECTS, method, setting, metric, against)

    def at(
        self, table: str, scenario: str, method: str, setting: str, metric: str = "error_r_deg",
        base: Base = ("", ""),
    ) -> Number | None:  # fmt: skip
        """Give the number at a place, if there is one."""
        return self._rows.get((table, scenario, method, setting, *base, metric))

    def settings(self, ablation: str, method: str) -> list[str]:
        """Name the settings of an ablation that a method was run with, in the paper's order."""
        found = {
            row.setting
            for row in self._rows.values()
            if row[:3] == (ABLATIONS[ablation].table, UNSEEN_OBJECTS, method)
            and row.setting.startswith(f"{ablation}=")
        }
        return sorted(found, key=setting_rank)


def below(row: Number, bound: float = 0.0) -> bool:
    """Tell whether an interval lies entirely below a bound."""
    return row.high < bound


def above(row: Number, bound: float = 0.0) -> bool:
    """Tell whether an interval lies entirely above a bound."""
    return row.low > bound


def within(row: Number, bound: float) -> bool:
    """Tell whether an interval stays within plus and minus a bound."""
    return max(-row.low, row.high) <= bound


Test = Callable[[Number, float], bool]


def weigh(
    rows: Sequence[Number | None], claimed: Test, refuted: Test, bound: float = 0.0
) -> Verdict:
    """Weigh a claim about every one of some comparisons with a bound; see ``RULE``."""
    found = [row for row in rows if row is not None]
    if any(refuted(row, bound) for row in found):
        return "not confirmed"
    if not rows or len(found) < len(rows):
        return "not run"
    return "confirmed" if all(claimed(row, bound) for row in found) else "undecided"


def weigh_some(rows: Sequence[Number], claimed: Test, refuted: Test, bound: float = 0.0) -> Verdict:
    """Weigh a claim that holds if one of some comparisons is on its side."""
    opposite: dict[Verdict, Verdict] = {"confirmed": "not confirmed", "not confirmed": "confirmed"}
    nowhere = weigh(rows, refuted, claimed, bound)
    return opposite.get(nowhere, nowhere)


Rule = Callable[[Sequence[Number | None]], Verdict]


def less(rows: Sequence[Number | None]) -> Verdict:
    """Weigh the claim that all are below zero: one errs less than the others."""
    return weigh(rows, below, above)


def more(rows: Sequence[Number | None], bound: float = 0.0) -> Verdict:
    """Weigh the claim that all are above a bound."""
    return weigh(rows, above, below, bound)


def weigh_same(rows: Sequence[Number | None]) -> Verdict:
    """Weigh the claim that nothing differs."""
    return weigh(rows, within, lambda row, _: above(row) or below(row), NO_DIFFERENCE_DEG)


def say(row: Number, name: str | None = None) -> str:
    """Say a number with its unit and interval: ``FGR 2.1° [1.9, 2.4]``."""
    return f"{name or shown(row.method).name} {said(row)}"


def said(row: Number) -> str:
    """Give a number with its unit and interval; a contrast has its sign."""
    unit = {"deg": "°", "%": " %"}.get(unit_of(row.metric, ""), f" {unit_of(row.metric, '')}")
    signed = row.base_setting != "" and not row.metric.endswith("_percent")
    texts = (show_bound(row.metric, number) for number in row[7:10])
    value, low, high = (
        f"+{text}" if signed and number > 0 and text != UNRESOLVED else text
        for text, number in zip(texts, row[7:10], strict=True)
    )
    return f"{value}{unit} [{low}, {high}]"


def listed(rows: Iterable[Number]) -> str:
    """Say contrasts one after the other, each under the name of what it is held against."""
    ordered = sorted(rows, key=lambda row: row.value)
    return ", ".join(say(row, shown(row.base_method).name) for row in ordered)
