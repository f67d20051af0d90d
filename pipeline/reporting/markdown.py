"""The tables as one Markdown file."""

from collections.abc import Mapping, Sequence

from pipeline.reporting.background import PairFacts
from pipeline.reporting.findings import ELSEWHERE, RULE, Finding
from pipeline.reporting.tables import Row
from pipeline.reporting.views import (
    HEADINGS,
    MARKS,
    Line,
    Table,
    show_bound,
    show_metric,
    unit_of,
)

LEGEND = (
    "A cell reads `ours (paper) [95 % bootstrap interval over pairs]`; the paper prints no number"
    " where the parentheses are missing. R is rotation in degrees, t translation in the unit of"
    " the data. A pair on which a method fails counts as the identity pose. "
    + "; ".join(f"{mark} {meaning}" for mark, meaning in MARKS.items())
    + ". The spread over draws is the standard deviation of ERROR(R) over draws of the noise; its"
    " interval is that of a standard deviation of normal values."
)


def render_markdown(
    tables: Sequence[Table],
    facts: Mapping[str, PairFacts],
    banner: str | None,
    findings: Sequence[Finding] = (),
) -> str:
    """Write what was found, then all tables, with floors, the paper's numbers and footnotes."""
    head = ["# Results", *([f"**{banner}**"] if banner else [])]
    found = [ELSEWHERE]
    if findings:
        found = ["## What we found", RULE, "\n".join(map(_finding, findings)), "## Tables"]
    return "\n\n".join([*head, *found, LEGEND, *(_table(table, facts) for table in tables)]) + "\n"


def _finding(finding: Finding) -> str:
    head = f"- **{finding.topic}: {finding.verdict}.** {finding.claim}"
    return "\n".join([head, *(f"  - {sentence}" for sentence in finding.ours)])


def _table(table: Table, facts: Mapping[str, PairFacts]) -> str:
    _, scenario, _, subset = table.key
    unit = facts[scenario].unit
    aside = ", asymmetric shapes only" if subset == "asymmetric" else ""
    head = [f"{HEADINGS[m]}, {unit_of(m, unit)}" for m in table.metrics]
    lines = [
        f"| {' | '.join(['Method', *head, 'failures'])} |",
        f"|{'|'.join(['---', *(['---:'] * (len(head) + 1))])}|",
        *(_line(line, table.metrics) for line in table.lines),
    ]
    notes = [f"{number}. {note}" for number, note in enumerate(table.notes, start=1)]
    absent = [f"Not run here: {', '.join(table.absent)}."] if table.absent else []
    return "\n\n".join(
        [
            f"## {table.title}{aside}",
            f"{table.pairs} test pairs.",
            "\n".join(lines),
            "\n".join(notes),
            *absent,
        ]
    )


def _line(line: Line, metrics: Sequence[str]) -> str:
    setting = f", {line.setting.replace(',', ', ')}" if line.setting != "paper" else ""
    name = f"{line.name}{setting}{line.marks} [{line.note}]"
    cells = [_cell(line.cells.get(metric)) for metric in metrics]
    return f"| {' | '.join([name, *cells, str(line.failures)])} |"


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    paper = f" ({show_metric(row.metric, row.paper)})" if row.paper is not None else ""
    interval = f"[{show_bound(row.low)}, {show_bound(row.high)}]"
    return f"{show_metric(row.metric, row.value)}{paper} {interval}"
