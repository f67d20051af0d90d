"""Markdown that reads, and LaTeX that pastes: escaped, balanced, as many cells as heads."""

import re
from pathlib import Path

import pytest

from pipeline.reporting.claims import Finding
from pipeline.reporting.documents import ESCAPED, render_latex, render_markdown, replaced
from pipeline.reporting.report import make_contents
from pipeline.reporting.tables import Table
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    write_everything,
    write_verified,
)
from tests.pipeline.reporting.test_tables import tables_of, write_floors

SCENARIOS = ("modelnet40-unseen_objects", "kitti")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Table], str]:
    """Tables, and the LaTeX of them."""
    folder: Path = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, SCENARIOS, 6)
    parts = (folder / name for name in ("results", "models", "pairs", "benchmarks"))
    tables = [*make_contents(*parts, profile="quick", provenance=None).tables]
    return tables, render_latex(tables, "quick profile: 100 % synthetic")


def test_begins_with_the_warning_as_a_comment(made: tuple[list[Table], str]) -> None:
    assert made[1].startswith("% quick profile: 100 % synthetic\n% Needs \\usepackage{booktabs}")


def test_each_table_is_whole_and_has_a_label_of_its_own(made: tuple[list[Table], str]) -> None:
    tables, text = made
    for command in ("begin{table*}", "end{table*}", "toprule", "bottomrule", "caption"):
        assert text.count(f"\\{command}") == len(tables)
    assert text.count("{") - text.count(r"\{") == text.count("}") - text.count(r"\}")
    labels = re.findall(r"\\label\{(.*?)\}", text)
    assert len({*labels}) == len(labels) == len(tables)


def test_every_row_has_as_many_cells_as_its_table_has_columns(
    made: tuple[list[Table], str],
) -> None:
    bodies = re.findall(r"\\begin\{tabular\}\{(l?r*)\}(.*?)\\end\{tabular\}", made[1], re.DOTALL)
    assert len(bodies) == len(made[0])
    for columns, body in bodies:
        rows = [line for line in body.splitlines() if line.endswith(r"\\")]
        assert len(rows) > 3
        assert {len(re.findall(r"(?<!\\)&", row)) + 1 for row in rows} == {len(columns)}


def test_nothing_that_tex_would_read_otherwise_is_left_bare(made: tuple[list[Table], str]) -> None:
    body = "\n".join(line for line in made[1].splitlines() if not line.startswith("%"))
    body = re.sub(r"\\label\{.*?\}|\{!\}\{%$|\\mathbf|\$\^\\d*dagger\$|\$\^\\circ\$", "", body,
                  flags=re.MULTILINE)  # fmt: skip
    assert not re.search(r"(?<!\\)[%_#]", body)
    assert r"steps=1,sampler=ddpm$" not in body
    assert "°" not in made[1]


def test_escaping_keeps_what_is_meant() -> None:
    assert replaced("rotation_6d, 50 % & {x} \\ 5° < 6", ESCAPED) == (
        r"rotation\_6d, 50 \% \& \{x\} \textbackslash{} 5$^\circ$ $<$ 6"
    )


def test_ours_stand_beside_the_papers(made: tuple[list[Table], str]) -> None:
    assert re.search(
        r"PCRDiffusion CF, steps=2, sampler=ddpm.*\(3\.1962\) \{\\scriptsize \[", made[1]
    )


def test_markdown_says_ours_beside_the_papers_and_warns(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=0.5, shift=0.05))
    text = render_markdown(tables_of(tmp_path), "quick profile: not a reproduction")
    assert "\n\n**quick profile: not a reproduction**\n\n" in text
    assert "| PCRNet [2] | 0.5000 (19.8457) [0.500, 0.500] |" in text
    assert "Training: training budget not recorded." in text
    assert "Not run here: ICP, " in text
    assert " PointNetLK, DeepGMR, " in text


def test_every_row_of_markdown_has_as_many_cells_as_its_head(made: tuple[list[Table], str]) -> None:
    text = render_markdown(made[0], None)
    blocks = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert len(blocks) == len(made[0])
    for block in blocks:
        assert len({line.count("|") for line in block.splitlines()}) == 1
    assert "\n\n\n" not in text


def test_markdown_ends_with_which_answers_to_trust(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 6)
    write_verified(tmp_path / "results", "kitti", 6)
    parts = (tmp_path / name for name in ("results", "models", "pairs", "benchmarks"))
    contents = make_contents(*parts, profile="quick", provenance=None)
    text = render_markdown(contents.tables, None, trust=contents.trust)
    section = text[text.index("## Which answers to trust") :]
    assert "the validation pairs of the same scenario" in section
    block = re.findall(r"^\|.*$", section, re.MULTILINE)
    assert len(block) == 4
    assert len({line.count("|") for line in block}) == 1
    assert block[2].startswith("| KITTI | GICP, random starts, fast | 6 | ")
    assert " | 0.0 [0, 0] | " in block[2]  # trusted
    assert "\n\n\n" not in text
    assert "trust" not in render_markdown(contents.tables, None)


def test_an_unresolved_angle_is_the_same_in_both(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=1e-7, shift=0.05))
    tables = tables_of(tmp_path)
    assert "| PCRNet [2] | < 1e-6 (19.8457) | 0.0500" in render_markdown(tables, None)
    assert r"PCRNet\textsuperscript{2} & $<$ 1e-6 (19.8457) & 0.0500" in render_latex(tables, None)


def test_results_begin_with_what_was_found() -> None:
    finding = Finding("Speed", "CF is fastest.", ("Ours: 0.1 s [0.1, 0.2].",), "undecided")
    text = render_markdown([], "a warning", [finding])
    assert text.index("a warning") < text.index("## What we found") < text.index("## Tables")
    assert "- **Speed: undecided.** CF is fastest.\n  - Ours: 0.1 s [0.1, 0.2].\n" in text
