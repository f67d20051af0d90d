"""The tables a reader sees: their order, floors, marks and footnotes."""

from math import nan
from pathlib import Path

import pandas as pd
import pytest
import torch

from pcrdiff.registration import Pairs
from pipeline.reporting.numbers import SPREAD
from pipeline.reporting.paper import FLOORS, MAE_AND_ERROR, setting_rank
from pipeline.reporting.reading import PairFile, Training
from pipeline.reporting.report import make_contents
from pipeline.reporting.tables import Cell, Table, best, make_tables, unbeaten
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)
from tests.pipeline.reporting.test_numbers import UNSEEN, numbers_of


def file_of(scenario: str = UNSEEN, source: str = "synthetic") -> PairFile:
    poses, items = torch.zeros(0, 4, 4, dtype=torch.float64), torch.zeros(0, dtype=torch.int64)
    test = Pairs(torch.zeros(0, 1, 3), torch.zeros(0, 1, 3), poses, items, ())
    return PairFile(scenario, source, "unit sphere", 7, 1, {}, test)


def tables_of(folder: Path, *trainings: Training) -> list[Table]:
    return make_tables(numbers_of(folder), trainings, {UNSEEN: file_of(), "kitti": file_of()})


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> list[Table]:
    """The tables of a few methods on unseen objects."""
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, (UNSEEN,), 12)
    parts = (folder / name for name in ("results", "models", "pairs", "benchmarks"))
    return [*make_contents(*parts, profile="quick", provenance=None).tables]


def table_of(tables: list[Table], number: str, ablated: str = "") -> Table:
    (found,) = [
        table
        for table in tables
        if table.label == "-".join(filter(None, (number, UNSEEN, ablated, "all")))
    ]
    return found


def settings_of(table: Table) -> list[str]:
    return [line.setting for line in table.lines if not line.is_floor]


def test_steps_stand_in_table_7_by_sampler(tables: list[Table]) -> None:
    table = table_of(tables, "7", "steps")
    assert settings_of(table)[:10] == [
        f"steps={steps},sampler={sampler}"
        for sampler in ("ddpm", "ddim")
        for steps in (1, 2, 4, 8, 16)
    ]
    assert table.absent == ()
    assert table.metrics[-1] == SPREAD
    assert all(SPREAD in line.cells for line in table.lines if not line.is_floor)


def test_ablations_keep_the_order_of_the_paper(tables: list[Table]) -> None:
    third = [
        (line.setting, line.method[-2:])
        for line in table_of(tables, "3", "diffusion").lines
        if not line.is_floor
    ]
    assert third == [(f"diffusion={x}", m) for x in ("without", "with") for m in ("cf", "cb")]
    assert settings_of(table_of(tables, "4", "representation"))[:3] == [
        "representation=quaternion,scaling=raw",
        "representation=quaternion,scaling=standardised",
        "representation=euler,scaling=raw",
    ]
    assert settings_of(table_of(tables, "5", "fusion")) == [
        "fusion=concat", "fusion=target", "fusion=source"
    ]  # fmt: skip
    assert setting_rank("noise=0.02") < setting_rank("noise=0.1")


def test_every_ablation_stands_on_the_floors(tables: list[Table]) -> None:
    for table in tables:
        assert [line.method for line in table.lines if line.is_floor] == [*FLOORS]


def test_an_ablations_row_tells_its_own_training(tables: list[Table]) -> None:
    notes = {
        (table.ablation, line.setting): table.notes[line.note - 1]
        for table in tables
        for line in table.lines
        if line.method == "pcrdiffusion_cf" and table.subset == "all"
    }
    assert "6 epochs" in notes["fusion", "fusion=target"]
    assert "30 epochs" in notes["steps", "steps=1,sampler=ddpm"]
    assert "does not converge" in notes["fusion", "fusion=concat"]
    assert "does not converge" not in notes["fusion", "fusion=source"]


def test_noise_tells_of_the_training_on_noise(tmp_path: Path) -> None:
    noisy = Training("modelnet40-gaussian_noise", "pcrnet", {"epochs": 77}, pd.DataFrame())
    clean = Training(UNSEEN, "pcrnet", {"epochs": 5}, pd.DataFrame())
    row = {"method": "pcrnet", **plain_row(0, off_deg=1.0), "setting": "noise=0.02"}
    write_rows(tmp_path / "ablations" / "noise.csv", [row])
    table = tables_of(tmp_path, clean, noisy)[0]
    assert "77 epochs" in table.notes[table.lines[-1].note - 1]


def test_table_6_has_accuracy_and_costs(tables: list[Table]) -> None:
    table = table_of(tables, "6")
    assert table.metrics == (*MAE_AND_ERROR, "seconds", "peak_memory_mib")
    assert all({*table.metrics} <= {*line.cells} for line in table.lines)
    cb = next(line for line in table.lines if line.method == "pcrdiffusion_cb")
    assert (cb.cells["seconds"].pairs, cb.cells["mae_t"].pairs) == (5, 12)
    cf = next(line for line in table.lines if line.method == "pcrdiffusion_cf")
    assert table.notes[cf.note - 1].endswith("The paper prints its time as below 1e-10 s.")


def test_bins_draws_and_contrasts_are_no_lines(tables: list[Table]) -> None:
    told = {line.setting for table in tables for line in table.lines}
    assert not [text for text in told if "minus" in text or "draw" in text or "_deg" in text]


def write_floors(folder: Path, learned: dict[str, object]) -> None:
    floors = {
        "identity": plain_row(0, off_deg=20.0, shift=0.4),
        "constant": plain_row(0, off_deg=10.0, shift=0.2),
        "icp_centroid": plain_row(0, off_deg=1.0, shift=0.1),
    }
    for method, row in (floors | {"pcrnet": learned}).items():
        write_rows(result_file(folder, UNSEEN, method), [row])


@pytest.mark.parametrize(
    ("off_deg", "shift", "marks"),
    [
        (0.5, 0.05, ""),
        (5.0, 0.15, "‡"),
        (0.5, 0.3, "†‡"),  # good angles do not excuse bad shifts
        (10.0, 0.2, "†‡"),  # a tie is no win
    ],
)
def test_marks_a_row_that_does_not_beat_a_floor(
    tmp_path: Path, off_deg: float, shift: float, marks: str
) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=off_deg, shift=shift))
    table = tables_of(tmp_path)[0]
    assert [line.method for line in table.lines] == [
        "identity",
        "constant",
        "icp_centroid",
        "pcrnet",
    ]
    assert [line.marks for line in table.lines] == ["", "", "", marks]


def test_a_note_claims_of_a_learned_row_the_authors_updates_and_no_more(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=0.5, shift=0.05))
    for method in ("icp", "rpmnet"):
        row = plain_row(0, off_deg=0.5, shift=0.05) | {"setting": "official"}
        write_rows(result_file(tmp_path, UNSEEN, method), [row])
    table = tables_of(tmp_path)[0]
    notes = {line.method: table.notes[line.note - 1] for line in table.lines}
    assert notes["icp"].startswith("Setting: the authors' own settings.")
    assert notes["rpmnet"].startswith("Setting: the authors' own number of updates.")
    assert notes["pcrnet"].startswith("Setting: the paper's iteration counts.")


def test_a_headline_is_the_papers_setting_where_there_is_one(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=5.0))
    rows = [
        plain_row(0, off_deg=k) | {"setting": s} for k, s in ((2.0, "paper"), (1.0, "official"))
    ]
    write_rows(result_file(tmp_path, UNSEEN, "rpmnet"), rows)
    write_rows(result_file(tmp_path, UNSEEN, "gicp"), rows[1:])
    table = tables_of(tmp_path)[0]
    assert table.is_main
    settings = {method: line.setting for method, line in table.headlines.items()}
    assert [*settings] == [*FLOORS, "gicp", "pcrnet", "rpmnet"]
    assert (settings["rpmnet"], settings["gicp"]) == ("paper", "official")


def test_the_best_is_none_of_the_floors(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=5.0, shift=0.2))
    table = tables_of(tmp_path)[0]
    winners = best(table.lines)
    assert (winners["error_r_deg"], winners["below_5_deg_percent"]) == (10.0, 0.0)
    assert best(line for line in table.lines if line.is_floor) == {}
    assert unbeaten([table]) == ["ModelNet40, unseen objects"]


@pytest.mark.parametrize(
    ("numbers", "ours", "interval"),
    [
        ((4e-7, 3e-7, 5e-7), "< 1e-6", None),
        ((4e-7, 0.0, 5e-7), "< 1e-6", None),
        ((4e-7, 0.0, 2e-6), "< 1e-6", ("0", "2e-06")),
        ((0.5, 4e-8, 1.6), "0.5000", ("< 1e-6", "1.60")),
        ((0.0, 0.0, 0.0), "0", ("0", "0")),
    ],
)
def test_an_angle_that_arithmetic_does_not_resolve_has_no_digits(
    numbers: tuple[float, float, float], ours: str, interval: tuple[str, str] | None
) -> None:
    cell = Cell("error_r_deg", *numbers, paper=nan, pairs=9)
    assert (cell.ours, cell.interval, cell.theirs) == (ours, interval, "")
    length = Cell("error_t", 4e-7, 3e-7, 5e-7, paper=0.5, pairs=9)
    assert (length.ours, length.interval, length.theirs) == ("4e-07", ("3e-07", "5e-07"), "0.5000")
