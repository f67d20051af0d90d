"""Rows of ``results.csv`` and the tables made of them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from pipeline.background import PairFacts
from pipeline.markdown import render_markdown
from pipeline.result_files import read_results
from pipeline.tables import Row, bootstrap_interval, format_rows, make_rows, measure, parse_rows
from pipeline.views import NOT_BELOW_CONSTANT, NOT_BELOW_ICP, banner, main_rows, make_tables, show
from tests.pipeline.made_up_results import plain_row, write_everything, write_rows

UNSEEN = "modelnet40-unseen_objects"


def rows_of(folder: Path) -> list[Row]:
    return make_rows(read_results(folder), seed=0)


def pick(rows: Sequence[Row], **wanted: str) -> Row:
    (found,) = [r for r in rows if all(getattr(r, name) == v for name, v in wanted.items())]
    return found


def facts(scenario: str = UNSEEN, source: str = "synthetic") -> PairFacts:
    return PairFacts(scenario, source, "unit sphere", 7, 1, 12, {})


def test_metrics_are_those_worked_by_hand(tmp_path: Path) -> None:
    # Two pairs: angles off by (0, 0, 0) and (3, 0, -6) degrees; shifts (0, 0, 0), (0.3, 0, 0.6).
    off = plain_row(1) | {"rx_deg": "3.0", "rz_deg": "-6.0", "tx": "0.3", "tz": "0.6"}
    off |= {"error_r_deg": "7.0", "error_t": "0.67"}
    write_rows(tmp_path / UNSEEN / "icp.csv", [plain_row(0), off])
    rows = {r.metric: r.value for r in rows_of(tmp_path) if r.subset == "all"}
    assert rows == pytest.approx(
        {
            "rmse_r_deg": (45 / 6) ** 0.5,
            "rmse_t": (0.45 / 6) ** 0.5,
            "mae_r_deg": 9 / 6,
            "mae_t": 0.9 / 6,
            "error_r_deg": 3.5,
            "error_t": 0.335,
            "median_error_r_deg": 3.5,
            "below_5_deg_percent": 50.0,
        },
        rel=1e-5,
    )


def test_optional_columns_become_recall_and_seconds(tmp_path: Path) -> None:
    extra = [{"recall": "1", "seconds": "0.5"}, {"recall": "0", "seconds": "1.5"}]
    rows = [plain_row(pair) | more for pair, more in enumerate(extra)]
    write_rows(tmp_path / "3dmatch-pairs" / "icp.csv", rows)
    found = rows_of(tmp_path)
    assert pick(found, metric="recall_percent").value == 50
    assert pick(found, metric="seconds").value == 1
    assert {row.table for row in found} == {"extra"}


def test_shapes_of_revolution_are_left_out_of_the_asymmetric_rows(tmp_path: Path) -> None:
    rows = [plain_row(0, off_deg=30.0, group="vase"), plain_row(1, off_deg=1.0)]
    write_rows(tmp_path / UNSEEN / "icp.csv", rows)
    write_rows(tmp_path / "kitti" / "icp.csv", rows)
    found = rows_of(tmp_path)
    asymmetric = pick(found, subset="asymmetric", metric="mae_r_deg")
    assert (asymmetric.value, asymmetric.pairs, asymmetric.paper) == (1.0, 1, None)
    whole = pick(found, subset="all", metric="mae_r_deg", scenario=UNSEEN)
    assert (whole.value, whole.pairs, whole.paper) == (15.5, 2, 11.7468)


def test_failures_are_counted_and_stay_in_the_mean(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(1, off_deg=20.0) | {"failure": "no matches"}]
    write_rows(tmp_path / "kitti" / "fgr.csv", rows)
    row = pick(rows_of(tmp_path), metric="error_r_deg")
    assert (row.failures, row.value, row.paper) == (1, 20.0, 3.2)


def test_intervals_hold_the_value_and_are_the_same_twice(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN,), 30)
    rows = rows_of(tmp_path / "results")
    assert format_rows(rows) == format_rows(rows_of(tmp_path / "results"))
    assert all(row.low <= row.value <= row.high for row in rows)
    assert any(row.low < row.high for row in rows)


def test_the_interval_of_a_mean_is_as_wide_as_theory_says(tmp_path: Path) -> None:
    generator = np.random.default_rng(3)
    values = generator.normal(10, 2, 400)
    resamples = generator.integers(400, size=(2000, 400))
    write_rows(tmp_path / "kitti" / "icp.csv", [plain_row(0)])
    mean = measure(read_results(tmp_path)[0])["error_r_deg"][1]
    low, high = bootstrap_interval(values, mean, resamples)
    assert high - low == pytest.approx(2 * 1.96 * values.std() / 20, rel=0.1)
    assert low < 10 < high


def test_results_csv_has_the_agreed_columns_and_reads_back(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN,), 5)
    rows = rows_of(tmp_path / "results")
    text = format_rows(rows)
    columns = "table,scenario,subset,method,setting,metric,value,low,high,paper,pairs,failures"
    assert text.splitlines()[0] == columns
    assert "\r" not in text
    assert parse_rows(text) == rows
    with pytest.raises(ValueError, match=r"results\.csv needs the columns"):
        parse_rows("table,value\n")


def test_steps_stand_in_table_7_beside_the_papers_numbers(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN,), 5)
    rows = rows_of(tmp_path / "results")
    row = pick(rows, table="7", setting="steps=2", metric="error_r_deg", subset="all")
    assert row.paper == 3.1962
    (table,) = [t for t in make_tables(rows, [], {UNSEEN: facts()}) if t.key[0::3] == ("7", "all")]
    settings = [line.setting for line in table.lines if not line.is_floor]
    assert settings == ["steps=1", "steps=2", "steps=4", "steps=16"]


def write_floors(folder: Path, learned: dict[str, object]) -> None:
    floors = {
        "identity": plain_row(0, off_deg=20.0, shift=0.4),
        "constant": plain_row(0, off_deg=10.0, shift=0.2),
        "icp_centroid": plain_row(0, off_deg=1.0, shift=0.1),
    }
    for method, row in (floors | {"pcrnet": learned}).items():
        write_rows(folder / UNSEEN / f"{method}.csv", [row])


@pytest.mark.parametrize(
    ("off_deg", "shift", "marks"),
    [
        (0.5, 0.05, ""),
        (5.0, 0.15, NOT_BELOW_ICP),
        (0.5, 0.3, NOT_BELOW_CONSTANT + NOT_BELOW_ICP),  # good angles do not excuse bad shifts
        (10.0, 0.2, NOT_BELOW_CONSTANT + NOT_BELOW_ICP),  # a tie is no win
    ],
)
def test_marks_a_row_that_does_not_beat_a_floor(
    tmp_path: Path, off_deg: float, shift: float, marks: str
) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=off_deg, shift=shift))
    table = make_tables(rows_of(tmp_path), [], {UNSEEN: facts()})[0]
    assert [line.method for line in table.lines] == [
        "identity",
        "constant",
        "icp_centroid",
        "pcrnet",
    ]
    assert [line.marks for line in table.lines] == ["", "", "", marks]


def test_markdown_says_ours_beside_the_papers_and_warns(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=0.5, shift=0.05))
    warning = banner("quick", [facts()])
    tables = make_tables(rows_of(tmp_path), [], {UNSEEN: facts()})
    text = render_markdown(tables, {UNSEEN: facts()}, warning)
    assert "**quick profile: not a reproduction (synthetic data: all of it)**" in text
    assert "| PCRNet [2] | 0.5000 (19.8457) [0.500, 0.500] |" in text
    assert "Training: training budget not recorded." in text
    assert "Not run here: ICP, " in text
    assert " PointNetLK, DeepGMR, " in text


def test_only_the_paper_profile_on_real_data_goes_without_a_banner() -> None:
    real, made_up = facts(source="download"), facts("kitti")
    assert banner("paper", [real]) is None
    assert banner("paper", [real, made_up]) == (
        "paper profile: not a reproduction (synthetic data: KITTI)"
    )
    assert banner("cpu", [real]) == "cpu profile: not a reproduction"
    assert banner("paper", [facts(source="unknown")]) is not None


def test_headlines_prefer_the_papers_setting(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(0, off_deg=1.0) | {"setting": "official"}]
    write_rows(tmp_path / UNSEEN / "rpmnet.csv", rows)
    write_rows(tmp_path / "kitti" / "rpmnet.csv", rows[1:])
    chosen = main_rows(rows_of(tmp_path), "error_r_deg")
    assert chosen[UNSEEN, "rpmnet"].setting == "paper"
    assert chosen["kitti", "rpmnet"].setting == "official"


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (23.15478, "23.1548"), (0.00005, "0.0001"), (2e-6, "2e-06")]
)
def test_prints_numbers_as_the_paper_does_without_hiding_small_ones(
    value: float, text: str
) -> None:
    assert show(value) == text


def test_a_note_claims_of_a_learned_row_the_authors_updates_and_no_more(tmp_path: Path) -> None:
    write_floors(tmp_path, plain_row(0, off_deg=0.5, shift=0.05))
    for method in ("icp", "rpmnet"):
        row = plain_row(0, off_deg=0.5, shift=0.05) | {"setting": "official"}
        write_rows(tmp_path / UNSEEN / f"{method}.csv", [row])
    table = make_tables(rows_of(tmp_path), [], {UNSEEN: facts()})[0]
    notes = {line.method: table.notes[line.note - 1] for line in table.lines}
    assert notes["icp"].startswith("Setting: the authors' own settings.")
    assert notes["rpmnet"].startswith("Setting: the authors' own number of updates.")
    assert notes["pcrnet"].startswith("Setting: the paper's iteration counts.")
