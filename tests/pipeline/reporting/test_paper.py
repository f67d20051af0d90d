"""The paper's numbers, typed by hand, against the paper's own text."""

import re

import pytest

from pipeline.reporting.paper import (
    ACCURACY,
    MAE_AND_ERROR,
    METHODS,
    PRINTED,
    PRINTED_AT,
    SCENARIOS,
    UNSEEN_OBJECTS,
    in_order,
    method_rank,
    printed,
    scenario_rank,
    setting_rank,
    shown,
    varied,
)
from tests.described import REPOSITORY

PAPER = REPOSITORY.parent / "shared" / "paper"
NAMES = {"DCP": "dcp_v2",
         "PCRDiffusion Correspondence-Free": "pcrdiffusion_cf", "PCRDiffusion": "pcrdiffusion_cb",
         "PCRDiffusion Correspondence-Based": "pcrdiffusion_cb",
         "PCRDiffusion (CF)": "pcrdiffusion_cf", "PCRDiffusion (CB)": "pcrdiffusion_cb",
         **{entry.name: method for method, entry in METHODS.items()}}  # fmt: skip
FUSED = (
    ("$F_{t}⊕F_{P}⊕F_{Q}$", "fusion=concat"),
    ("$F_{P}⊕(F_{t}+F_{Q})$", "fusion=target"),
    ("$(F_{t}+F_{P})⊕F_{Q}$", "fusion=source"),
)


@pytest.fixture(scope="module")
def tables() -> list[list[list[str]]]:
    """The tables of the paper's LaTeX text: rows of cells, rid of their markup."""
    texts = sorted(PAPER.glob("*.txt"))
    if not texts:
        pytest.skip("the paper's text is not beside the repository")
    text = "\n".join(re.sub(r"(?<!\\)%.*", "", line) for line in texts[0].read_text().splitlines())
    bodies = re.findall(r"\\begin\{tabular\}(.*?)\\end\{tabular\}", text, flags=re.DOTALL)
    return [parse_rows(body) for body in bodies]


def parse_rows(body: str) -> list[list[str]]:
    rows = [[clean(cell) for cell in row.split("&")] for row in re.split(r"\\\\(?!\()", body)]
    return [row for row in rows if any(row)]


def clean(cell: str) -> str:
    cell = re.sub(
        r"\\cite\{[^}]*\}|\\(mid|top|bottom)rule(\[[^]]*\])?|\(\$\\\w*triangle\w*\$\)", "", cell
    )
    cell = re.sub(r"\\(textbf|text|mathcal)\{([^{}]*)\}", r"\2", cell)
    return re.sub(r"\s+", " ", cell.replace("\\oplus", "⊕")).strip()


def numbers(cells: list[str]) -> list[float]:
    return [float(cell) for cell in cells]


def find(tables: list[list[list[str]]], first: str, columns: int) -> list[list[str]]:
    """Find the table that has a row with this first cell and so many columns."""
    (found,) = [t for t in tables if any(r[0] == first and len(r) == columns for r in t)]
    return found


Key = tuple[str, ...]
"""Table, scenario, method, setting and metric."""


def expected(table: str) -> dict[Key, float]:
    """Our copy of a table, or of all tables whose number begins so."""
    here = PRINTED[PRINTED["table"].str.startswith(table)]
    found: dict[Key, float] = here.set_index(PRINTED_AT)["paper"].to_dict()
    return found


def test_every_number_of_table_1_is_the_papers(tables: list[list[list[str]]]) -> None:
    parts = iter([name for name, entry in SCENARIOS.items() if entry.table.startswith("1")])
    found: dict[Key, float] = {}
    scenario = ""
    for row in find(tables, "RPMNet", 8):
        if "multicolumn" in row[0]:
            scenario = next(parts)
        elif row[0] in NAMES:
            key = (SCENARIOS[scenario].table, scenario, NAMES[row[0]], "paper")
            found |= {(*key, m): v for m, v in zip(ACCURACY, numbers(row[1:7]), strict=True)}
    assert found == expected("1")
    assert len(found) == 39 * 6


def test_every_number_of_table_2_is_the_papers(tables: list[list[list[str]]]) -> None:
    found: dict[Key, float] = {}
    for row in find(tables, "RPMNet", 13):
        if row[0] in NAMES:
            for scenario, cells in (("kitti", row[1:7]), ("3dmatch", row[7:])):
                for metric, value in zip(ACCURACY, numbers(cells), strict=True):
                    found["2", scenario, NAMES[row[0]], "paper", metric] = value
    assert found == expected("2")
    assert len(found) == 9 * 12


@pytest.mark.parametrize(
    ("table", "settings"),
    [
        (
            "3",
            {
                "(a) w/ diffusion (CF)": ("pcrdiffusion_cf", "diffusion=without"),
                "(b) w/ diffusion (CB)": ("pcrdiffusion_cb", "diffusion=without"),
                "(c) PCRDiffusion (CF)": ("pcrdiffusion_cf", "diffusion=with"),
                "(d) PCRDiffusion (CB)": ("pcrdiffusion_cb", "diffusion=with"),
            },
        ),
        (
            "4",
            {
                "7-dimensional vectors": (
                    "pcrdiffusion_cb",
                    "representation=quaternion,scaling=raw",
                ),
                "6-dimensional vectors": ("pcrdiffusion_cb", "representation=euler,scaling=raw"),
            },
        ),
        ("5", {cell: ("pcrdiffusion_cf", setting) for cell, setting in FUSED}),
        ("7", {str(n): ("pcrdiffusion_cf", f"steps={n},sampler=ddpm") for n in (1, 2, 4, 8)}),
    ],
)
def test_every_number_of_the_ablations_is_the_papers(
    tables: list[list[list[str]]], table: str, settings: dict[str, tuple[str, str]]
) -> None:
    rows = {row[0]: row[1:] for row in find(tables, next(iter(settings)), 5)}
    found = {
        (table, UNSEEN_OBJECTS, *settings[name], metric): float(cell)
        for name in settings
        for metric, cell in zip(MAE_AND_ERROR, rows[name], strict=True)
        if cell != "-"
    }
    assert found == expected(table)


def test_every_number_of_table_6_is_the_papers(tables: list[list[list[str]]]) -> None:
    found: dict[Key, float] = {}
    for row in find(tables, "RPMNet", 6):
        if row[0] in NAMES:
            seconds = "1e-10" if row[5].startswith(r"\textless") else row[5]
            for metric, cell in zip((*MAE_AND_ERROR, "seconds"), [*row[1:5], seconds], strict=True):
                found["6", UNSEEN_OBJECTS, NAMES[row[0]], "paper", metric] = float(cell)
    assert found == expected("6")


def test_every_number_is_there_once_and_above_zero() -> None:
    assert len(PRINTED) == 440
    assert not PRINTED.duplicated(PRINTED_AT).any()
    assert (PRINTED["paper"] > 0).all()


def test_a_number_the_paper_does_not_print_is_none() -> None:
    assert printed("1a", UNSEEN_OBJECTS, "rpmnet") == 2.9619
    assert printed("1a", UNSEEN_OBJECTS, "rpmnet", metric="mae_t") == 0.0170
    assert printed("1d", "modelnet40-partial", "pcrdiffusion_cf") is None


def test_a_setting_is_what_it_varies() -> None:
    assert varied("steps=4,sampler=ddim") == {"steps": "4", "sampler": "ddim"}
    assert varied("paper") == varied("") == {}


def test_settings_follow_the_paper_and_numbers_their_size() -> None:
    settings = ["fusion=source", "fusion=target", "fusion=other", "fusion=concat"]
    assert sorted(settings, key=setting_rank) == [
        "fusion=concat", "fusion=target", "fusion=source", "fusion=other"
    ]  # fmt: skip
    assert setting_rank("steps=8,sampler=ddpm") < setting_rank("steps=16,sampler=ddpm")
    assert setting_rank("steps=16,sampler=ddpm") < setting_rank("steps=1,sampler=ddim")
    assert setting_rank("noise=0.02") < setting_rank("noise=0.1")


def test_a_method_or_scenario_nobody_named_comes_last_under_its_own_name() -> None:
    assert sorted(["zzz", "pcrdiffusion_cb", "identity"], key=method_rank)[-1] == "zzz"
    assert sorted(["aaa", "3dmatch", "kitti"], key=scenario_rank) == ["kitti", "3dmatch", "aaa"]
    assert shown("zzz").name == "zzz"
    assert in_order(["zzz", "icp", "identity", "icp"]) == ["identity", "icp", "zzz"]
