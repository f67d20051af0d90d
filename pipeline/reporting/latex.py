r"""The tables as LaTeX to paste into a paper that loads ``booktabs``."""

import re
from collections.abc import Mapping, Sequence

from pipeline.reporting.background import PairFacts
from pipeline.reporting.tables import RESAMPLES, Row
from pipeline.reporting.views import (
    HEADINGS,
    NOT_BELOW_CONSTANT,
    NOT_BELOW_ICP,
    Line,
    Table,
    show_bound,
    show_metric,
    unit_of,
)

MADE = (
    "Needs \\usepackage{booktabs} and \\usepackage{graphicx}. Made from what results.csv holds"
    " by the stage `report`: the same results, the same bytes.",
    f"A cell reads: ours (the paper's) [95 % interval of a bootstrap over test pairs, {RESAMPLES}"
    " resamples].",
)
SYMBOLS = {NOT_BELOW_CONSTANT: r"$^\dagger$", NOT_BELOW_ICP: r"$^\ddagger$"}
MEANINGS = (
    r"$^\dagger$: does not beat the constant pose; $^\ddagger$: does not beat ICP from the"
    r" centroids, in both ERROR($\mathbf{R}$) and ERROR($\mathbf{t}$)."
)
ESCAPED = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "°": r"$^\circ$",
    "<": r"$<$", ">": r"$>$",
}  # fmt: skip


def render_latex(
    tables: Sequence[Table], facts: Mapping[str, PairFacts], banner: str | None
) -> str:
    """Write one ``table*`` for each table, with floors, the paper's numbers and footnotes."""
    comments = [f"% {line}" for line in (*([banner] if banner else []), *MADE)]
    return "\n".join([*comments, *(f"\n{_table(table, facts)}" for table in tables)]) + "\n"


def escape(text: str) -> str:
    """Write text so that LaTeX prints it as it is."""
    return "".join(ESCAPED.get(letter, letter) for letter in text)


def _table(table: Table, facts: Mapping[str, PairFacts]) -> str:
    number, scenario, ablated, subset = table.key
    label = "-".join(part for part in (number, scenario, ablated, subset) if part)
    aside = ", asymmetric shapes only" if subset == "asymmetric" else ""
    notes = [rf"\textsuperscript{{{n}}} {escape(note)}" for n, note in enumerate(table.notes, 1)]
    absent = [f"Not run here: {escape(', '.join(table.absent))}."] if table.absent else []
    head = ["Method", *(_heading(m, facts[scenario].unit) for m in table.metrics), "failures"]
    lines = [_line(line, table.metrics) for line in table.lines]
    floors = sum(line.is_floor for line in table.lines)
    return "\n".join(
        [
            r"\begin{table*}",
            r"\centering",
            rf"\caption{{{escape(table.title)}{aside}: {table.pairs} test pairs. {MEANINGS}}}",
            rf"\label{{tab:{label}}}",
            r"\resizebox{\textwidth}{!}{%",
            rf"\begin{{tabular}}{{l{'r' * (len(head) - 1)}}}",
            r"\toprule",
            rf"{' & '.join(head)} \\",
            r"\midrule",
            *lines[:floors],
            *([r"\midrule"] if floors and lines[floors:] else []),
            *lines[floors:],
            r"\bottomrule",
            r"\end{tabular}}",
            r"\par\smallskip\raggedright\scriptsize",
            *(rf"{note}\\" for note in [*notes, *absent]),
            r"\end{table*}",
        ]
    )


def _heading(metric: str, unit: str) -> str:
    name = re.sub(r"\((R|t)\)", r"($\\mathbf{\1}$)", escape(HEADINGS[metric]))
    return rf"{name} [{escape(unit_of(metric, unit))}]"


def _line(line: Line, metrics: Sequence[str]) -> str:
    setting = f", {line.setting.replace(',', ', ')}" if line.setting != "paper" else ""
    marks = "".join(SYMBOLS[mark] for mark in line.marks)
    name = rf"{escape(line.name + setting)}{marks}\textsuperscript{{{line.note}}}"
    cells = [_cell(line.cells.get(metric)) for metric in metrics]
    return rf"{' & '.join([name, *cells, str(line.failures)])} \\"


def _cell(row: Row | None) -> str:
    if row is None:
        return ""
    paper = f" ({show_metric(row.metric, row.paper)})" if row.paper is not None else ""
    interval = rf" {{\scriptsize [{show_bound(row.low)}, {show_bound(row.high)}]}}"
    return f"{show_metric(row.metric, row.value)}{paper}{interval}"
