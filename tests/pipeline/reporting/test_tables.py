"""Rows of ``results.csv`` and the tables made of them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.reporting.background import PairFacts, Training, read_pair_files, read_trainings
from pipeline.reporting.difficulty import measure_difficulties
from pipeline.reporting.findings import Finding
from pipeline.reporting.markdown import render_markdown
from pipeline.reporting.paper import FLOORS, MAE_AND_ERROR
from pipeline.reporting.result_files import read_results, read_times
from pipeline.reporting.tables import (
    Row,
    bootstrap_interval,
    format_rows,
    make_rows,
    measure,
    parse_rows,
)
from pipeline.reporting.views import (
    NOT_BELOW_CONSTANT,
    NOT_BELOW_ICP,
    SPREAD,
    Table,
    banner,
    main_rows,
    make_tables,
    setting_rank,
    show,
    spread,
)
from tests.pipeline.reporting.made_up_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)

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
    write_rows(result_file(tmp_path, UNSEEN, "icp"), [plain_row(0), off])
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
    write_rows(result_file(tmp_path, "3dmatch-pairs", "icp"), rows)
    found = rows_of(tmp_path)
    assert pick(found, metric="recall_percent").value == 50
    assert pick(found, metric="seconds").value == 1
    assert {row.table for row in found} == {"extra"}


def test_shapes_of_revolution_are_left_out_of_the_asymmetric_rows(tmp_path: Path) -> None:
    rows = [plain_row(0, off_deg=30.0, group="vase"), plain_row(1, off_deg=1.0)]
    write_rows(result_file(tmp_path, UNSEEN, "icp"), rows)
    write_rows(result_file(tmp_path, "kitti", "icp"), rows)
    found = rows_of(tmp_path)
    asymmetric = pick(found, subset="asymmetric", metric="mae_r_deg")
    assert (asymmetric.value, asymmetric.pairs, asymmetric.paper) == (1.0, 1, None)
    whole = pick(found, subset="all", metric="mae_r_deg", scenario=UNSEEN)
    assert (whole.value, whole.pairs, whole.paper) == (15.5, 2, 11.7468)


def test_failures_are_counted_and_stay_in_the_mean(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(1, off_deg=20.0) | {"failure": "no matches"}]
    write_rows(result_file(tmp_path, "kitti", "fgr"), rows)
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
    write_rows(result_file(tmp_path, "kitti", "icp"), [plain_row(0)])
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


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Row], list[Table]]:
    """All kinds of rows of a few methods on unseen objects, and their tables."""
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, (UNSEEN,), 12)
    scores, times = read_results(folder / "results"), read_times(folder / "results")
    difficulties = measure_difficulties(read_pair_files(folder / "pairs", [UNSEEN]))
    rows = make_rows(scores, times, difficulties, seed=0)
    return rows, make_tables(rows, read_trainings(folder / "models"), {UNSEEN: facts()})


def table_of(tables: Sequence[Table], number: str, ablated: str) -> Table:
    (found,) = [table for table in tables if table.key == (number, UNSEEN, ablated, "all")]
    return found


def settings_of(table: Table) -> list[str]:
    return [line.setting for line in table.lines if not line.is_floor]


def test_steps_stand_in_table_7_by_sampler_beside_the_papers_numbers(
    everything: tuple[list[Row], list[Table]],
) -> None:
    rows, tables = everything
    named = {"table": "7", "method": "pcrdiffusion_cf", "metric": "error_r_deg", "subset": "all"}
    assert pick(rows, setting="steps=2,sampler=ddpm", **named).paper == 3.1962
    assert pick(rows, setting="steps=2,sampler=ddim", **named).paper is None
    table = table_of(tables, "7", "steps")
    assert settings_of(table)[:10] == [
        f"steps={steps},sampler={sampler}"
        for sampler in ("ddpm", "ddim")
        for steps in (1, 2, 4, 8, 16)
    ]
    assert table.absent == ()


def test_the_spread_over_draws_is_the_deviation_of_their_means(
    everything: tuple[list[Row], list[Table]],
) -> None:
    rows, tables = everything
    means = [
        row.value
        for row in rows
        if row.method == "pcrdiffusion_cf"
        and (row.metric, row.subset, row.table) == ("error_r_deg", "all", "7")
        and row.setting.startswith("steps=2,sampler=ddpm")
        and row.kind != "contrast"
    ]
    assert len(means) == 3
    line = next(
        x for x in table_of(tables, "7", "steps").lines if x.setting == "steps=2,sampler=ddpm"
    )
    cell = line.cells[SPREAD]
    assert cell.value == pytest.approx(np.std(means, ddof=1))
    assert cell.low < cell.value < cell.high
    assert SPREAD not in {row.metric for row in rows}


def test_the_interval_of_a_spread_covers_as_often_as_it_says() -> None:
    generator = np.random.default_rng(4)
    row = Row("7", UNSEEN, "all", "m", "steps=1", "error_r_deg", 0.0, 0.0, 0.0, None, 9, 0)
    covered = [
        cell.low < 2.0 < cell.high
        for values in generator.normal(5, 2, (2000, 4))
        for cell in [spread([replace(row, value=float(value)) for value in values])]
    ]
    assert np.mean(covered) == pytest.approx(0.95, abs=0.015)


def test_ablations_keep_the_order_of_the_paper(everything: tuple[list[Row], list[Table]]) -> None:
    tables = everything[1]
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


def test_every_ablation_stands_on_the_floors(everything: tuple[list[Row], list[Table]]) -> None:
    for table in everything[1]:
        assert [line.method for line in table.lines if line.is_floor] == [*FLOORS]


def test_an_ablations_row_tells_its_own_training(
    everything: tuple[list[Row], list[Table]],
) -> None:
    notes = {
        (table.key[2], line.setting): table.notes[line.note - 1]
        for table in everything[1]
        for line in table.lines
        if line.method == "pcrdiffusion_cf" and table.key[3] == "all"
    }
    assert "6 epochs" in notes["fusion", "fusion=target"]
    assert "30 epochs" in notes["steps", "steps=1,sampler=ddpm"]
    assert "does not converge" in notes["fusion", "fusion=concat"]
    assert "does not converge" not in notes["fusion", "fusion=source"]


def test_noise_tells_of_the_training_on_noise(tmp_path: Path) -> None:
    noisy = Training("modelnet40-gaussian_noise", "pcrnet", {"epochs": 77}, {})
    clean = Training(UNSEEN, "pcrnet", {"epochs": 5}, {})
    row = {"method": "pcrnet", **plain_row(0, off_deg=1.0), "setting": "noise=0.02"}
    write_rows(tmp_path / "ablations" / "noise.csv", [row])
    table = make_tables(rows_of(tmp_path), [clean, noisy], {UNSEEN: facts()})[0]
    assert "77 epochs" in table.notes[table.lines[-1].note - 1]


def test_table_6_repeats_the_accuracy_of_what_was_timed(
    everything: tuple[list[Row], list[Table]],
) -> None:
    rows, tables = everything
    table = table_of(tables, "6", "")
    assert table.metrics == (*MAE_AND_ERROR, "seconds", "peak_memory_mib")
    assert all({*table.metrics} <= {*line.cells} for line in table.lines)
    cb = next(line for line in table.lines if line.method == "pcrdiffusion_cb")
    first = pick(rows, table="1a", method="pcrdiffusion_cb", metric="mae_t", subset="all",
                 setting="paper")  # fmt: skip
    assert cb.cells["mae_t"] == replace(first, table="6")
    assert (cb.cells["seconds"].pairs, cb.cells["mae_t"].pairs) == (5, 12)
    assert cb.cells["seconds"].paper == 0.0986
    cf = next(line for line in table.lines if line.method == "pcrdiffusion_cf")
    assert table.notes[cf.note - 1].endswith("The paper prints its time as below 1e-10 s.")


def test_a_contrast_is_the_mean_of_paired_differences(tmp_path: Path) -> None:
    for method, errors in (("pcrdiffusion_cb", (1.0, 2.0, 3.0)), ("fgr", (2.0, 3.0, 4.0))):
        rows = [plain_row(pair, off_deg=error) for pair, error in enumerate(errors)]
        write_rows(result_file(tmp_path, "kitti", method), rows)
    found = rows_of(tmp_path)
    row = pick(found, setting="paper minus fgr:paper", metric="error_r_deg")
    assert (row.value, row.low, row.high) == (-2.0, -2.0, -2.0)  # the pairs differ, not the methods
    assert (row.table, row.kind, row.paper) == ("2", "contrast", None)
    improvement = pick(found, setting="paper minus fgr:paper", metric="improvement_percent")
    assert improvement.value == pytest.approx(100 / 3, rel=1e-5)
    assert improvement.low < improvement.value < improvement.high


def test_no_improvement_is_told_over_a_method_that_errs_nowhere(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", "pcrdiffusion_cb"), [plain_row(0, off_deg=1.0)])
    write_rows(result_file(tmp_path, "kitti", "fgr"), [plain_row(0)])
    assert "improvement_percent" not in {row.metric for row in rows_of(tmp_path)}


def test_bins_draws_and_contrasts_are_no_lines(everything: tuple[list[Row], list[Table]]) -> None:
    rows, tables = everything
    assert {row.kind for row in rows} == {"line", "bin", "draw", "contrast"}
    told = {row.setting for row in rows if row.kind != "line"}
    assert told.isdisjoint({line.setting for table in tables for line in table.lines})
    assert {row.setting for row in main_rows(rows, "error_r_deg").values()} == {"paper"}


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
    write_rows(result_file(tmp_path, UNSEEN, "rpmnet"), rows)
    write_rows(result_file(tmp_path, "kitti", "rpmnet"), rows[1:])
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
        write_rows(result_file(tmp_path, UNSEEN, method), [row])
    table = make_tables(rows_of(tmp_path), [], {UNSEEN: facts()})[0]
    notes = {line.method: table.notes[line.note - 1] for line in table.lines}
    assert notes["icp"].startswith("Setting: the authors' own settings.")
    assert notes["rpmnet"].startswith("Setting: the authors' own number of updates.")
    assert notes["pcrnet"].startswith("Setting: the paper's iteration counts.")


def test_results_begin_with_what_was_found() -> None:
    finding = Finding("Speed", "CF is fastest.", ("Ours: 0.1 s [0.1, 0.2].",), "undecided")
    text = render_markdown([], {}, "a warning", [finding])
    assert text.index("a warning") < text.index("## What we found") < text.index("## Tables")
    assert "- **Speed: undecided.** CF is fastest.\n  - Ours: 0.1 s [0.1, 0.2].\n" in text
