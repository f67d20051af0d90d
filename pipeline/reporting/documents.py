"""The tables as Markdown, and as LaTeX to paste into a paper."""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from jinja2 import Environment, PackageLoader, StrictUndefined

from pcrdiff.geometry.metrics import RIGHT_DEG, RIGHT_T
from pcrdiff.verdict import MOST_WRONG
from pipeline.reporting.claims import ELSEWHERE, Finding
from pipeline.reporting.numbers import CALIBRATION, RESAMPLES, RIGHT, TRUST
from pipeline.reporting.paper import place
from pipeline.reporting.showing import HEADINGS
from pipeline.reporting.tables import MARKS, Line, Table
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
TRUST_COLUMNS = {name: HEADINGS[name] for name in (RIGHT, CALIBRATION, *TRUST)}
"""What a table of trust has of each method, in percent."""
TRUSTED = (
    f"The probability that an answer is right, off by less than {RIGHT_DEG:g}° and {RIGHT_T:g} of the"
    " unit sphere's radius, is a logistic function of how well and how clearly the clouds fit under"
    " it. It was fitted to the method's answers to the validation pairs of the same scenario, and is"
    " shown on the test pairs. An answer is trusted from the least probability on at which, of the"
    f" validation pairs, at most {100 * MOST_WRONG:g} % were wrong and no more were expected to be."
)
"""How an answer comes to be trusted."""
WORTH = (
    "A source is worth the starts that it saves: read how many random starts find as many pairs as one"
    " or four samples."
)
"""How to read what was found from so many starts."""
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
    made.globals.update(
        RULE=RULE, ELSEWHERE=ELSEWHERE, MARKS=MARKS, RESAMPLES=RESAMPLES, TRUSTED=TRUSTED,
        TRUST_COLUMNS=TRUST_COLUMNS, WORTH=WORTH,
    )  # fmt: skip
    return made


def render_markdown(
    tables: Sequence[Table],
    banner: str | None,
    findings: Sequence[Finding] = (),
    trust: Mapping[str, Sequence[Line]] = MappingProxyType({}),
    sources: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> str:
    """Write what was found, all tables, with floors and the paper's numbers, trust and starts."""
    template = environment().get_template("results.md.j2")
    return template.render(
        tables=tables, banner=banner, findings=findings, trust=trust, sources=sources, place=place
    )


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
