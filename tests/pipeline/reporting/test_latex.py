"""LaTeX that pastes: escaped, balanced, each row with as many cells as its head."""

import re
from pathlib import Path

import pytest

from pipeline.reporting.background import read_pair_files, read_trainings
from pipeline.reporting.latex import escape, render_latex
from pipeline.reporting.result_files import read_results, read_times
from pipeline.reporting.tables import make_rows
from pipeline.reporting.views import Table, make_tables
from tests.pipeline.reporting.made_up_results import write_everything

SCENARIOS = ("modelnet40-unseen_objects", "kitti")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Table], str]:
    """Tables, and the LaTeX of them."""
    folder: Path = tmp_path_factory.mktemp("made_up")
    write_everything(folder, SCENARIOS, 6)
    results = folder / "results"
    rows = make_rows(read_results(results), read_times(results), seed=0)
    files = read_pair_files(folder / "pairs", SCENARIOS)
    facts = {name: file.facts for name, file in files.items()}
    tables = make_tables(rows, read_trainings(folder / "models"), facts)
    return tables, render_latex(tables, facts, "quick profile: 100 % made up")


def test_begins_with_the_warning_as_a_comment(made: tuple[list[Table], str]) -> None:
    assert made[1].startswith("% quick profile: 100 % made up\n% Needs \\usepackage{booktabs}")


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
    assert escape("rotation_6d, 50 % & {x} \\ 5° < 6") == (
        r"rotation\_6d, 50 \% \& \{x\} \textbackslash{} 5$^\circ$ $<$ 6"
    )


def test_ours_stand_beside_the_papers(made: tuple[list[Table], str]) -> None:
    assert re.search(
        r"PCRDiffusion CF, steps=2, sampler=ddpm.*\(3\.1962\) \{\\scriptsize \[", made[1]
    )
