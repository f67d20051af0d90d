"""The tables as Markdown, and as LaTeX to paste into a paper."""

import re
from collections.abc import Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.reporting.claims import ELSEWHERE, Finding
from pipeline.reporting.numbers import RESAMPLES
from pipeline.reporting.tables import MARKS, Table
from pipeline.reporting.verdicts import RULE

TEX_DELIMITERS = {
    "block_start_string": "<%", "block_end_string": "%>",
    "variable_start_string": "<<", "variable_end_string": ">>",
    "comment_start_string": "<#", "comment_end_string": "#>",
}  # fmt: skip
"""LaTeX is full of braces."""
ESCAPED = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "°": r"$^\circ$",
    "<": r"$<$", ">": r"$>$",
}  # fmt: skip
SYMBOLS = {"†": r"$^\dagger$", "‡": r"$^\ddagger$"}


def environment(*, html: bool = False, delimiters: dict[str, str] | None = None) -> Environment:
    """Load the templates; a name that they do not know is an error."""
    made = Environment(
        loader=PackageLoader("pipeline.reporting"),
        autoescape=html,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        **(delimiters or {}),  # type: ignore[arg-type]
    )
    made.globals.update(RULE=RULE, ELSEWHERE=ELSEWHERE, MARKS=MARKS, RESAMPLES=RESAMPLES)
    return made


def render_markdown(
    tables: Sequence[Table], banner: str | None, findings: Sequence[Finding] = ()
) -> str:
    """Write what was found, then all tables, with floors, the paper's numbers and footnotes."""
    template = environment().get_template("results.md.j2")
    return template.render(tables=tables, banner=banner, findings=findings)


def render_latex(tables: Sequence[Table], banner: str | None) -> str:
    """Write one ``table*`` for each table, for a paper that loads ``booktabs`` and ``graphicx``."""
    made = environment(delimiters=TEX_DELIMITERS)
    made.filters.update(
        tex=lambda text: replaced(text, ESCAPED),
        symbols=lambda marks: replaced(marks, SYMBOLS),
        bold=lambda head: re.sub(r"\((R|t)\)", r"($\\mathbf{\1}$)", head),
    )
    return made.get_template("results.tex.j2").render(tables=tables, banner=banner)


def replaced(text: str, letters: dict[str, str]) -> str:
    """Write text with some of its letters written otherwise."""
    return "".join(letters.get(letter, letter) for letter in text)
