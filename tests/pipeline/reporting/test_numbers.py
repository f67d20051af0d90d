"""The numbers of ``results.csv``: worked by hand, with intervals that hold what they say."""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.reporting.difficulty import measure_difficulty
from pipeline.reporting.numbers import (
    COLUMNS,
    SPREAD,
    bootstrap_interval,
    make_numbers,
    spread_over_draws,
    statistic_of,
    write_numbers,
)
from pipeline.reporting.reading import choose, read_answers, read_pair_files, read_times
from tests.pipeline.reporting.synthetic_results import (
    VERIFIED,
    judged,
    plain_row,
    result_file,
    verdict_from,
    write_everything,
    write_rows,
)

UNSEEN = "modelnet40-unseen_objects"


def numbers_of(folder: Path) -> pd.DataFrame:
    answers, times = read_answers(folder), read_times(folder)
    return make_numbers(answers, times, measure_difficulty({}), seed=0)


def pick(numbers: pd.DataFrame, **wanted: object) -> pd.Series:
    found = choose(numbers, **wanted)
    assert len(found) == 1
    return found.iloc[0]


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """All kinds of numbers of a few methods on unseen objects."""
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, (UNSEEN,), 12)
    answers, times = read_answers(folder / "results"), read_times(folder / "results")
    difficulty = measure_difficulty(read_pair_files(folder / "pairs", [UNSEEN]))
    return make_numbers(answers, times, difficulty, seed=0)


def test_metrics_are_those_worked_by_hand(tmp_path: Path) -> None:
    # Two pairs: angles off by (0, 0, 0) and (3, 0, -6) degrees; shifts (0, 0, 0), (0.3, 0, 0.6).
    off = plain_row(1) | {"rx_deg": "3.0", "rz_deg": "-6.0", "tx": "0.3", "tz": "0.6"}
    off |= {"error_r_deg": "7.0", "error_t": "0.67"}
    write_rows(result_file(tmp_path, UNSEEN, "icp"), [plain_row(0), off])
    rows = choose(numbers_of(tmp_path), subset="all").set_index("metric")["value"]
    assert rows.to_dict() == pytest.approx(
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


def test_shapes_of_revolution_are_left_out_of_the_asymmetric_rows(tmp_path: Path) -> None:
    rows = [plain_row(0, off_deg=30.0, group="vase"), plain_row(1, off_deg=1.0)]
    write_rows(result_file(tmp_path, UNSEEN, "icp"), rows)
    write_rows(result_file(tmp_path, "kitti", "icp"), rows)
    found = numbers_of(tmp_path)
    asymmetric = pick(found, subset="asymmetric", metric="mae_r_deg")
    assert (asymmetric["value"], asymmetric["pairs"]) == (1.0, 1)
    assert np.isnan(asymmetric["paper"])
    whole = pick(found, subset="all", metric="mae_r_deg", scenario=UNSEEN)
    assert tuple(whole[["value", "pairs", "paper"]]) == (15.5, 2, 11.7468)


def test_failures_are_counted_and_stay_in_the_mean(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(1, off_deg=20.0) | {"failure": "no matches"}]
    write_rows(result_file(tmp_path, "kitti", "fgr"), rows)
    row = pick(numbers_of(tmp_path), metric="error_r_deg")
    assert tuple(row[["failures", "value", "paper"]]) == (1, 20.0, 3.2)


def test_intervals_hold_the_value_and_are_the_same_twice(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN,), 30)
    numbers = numbers_of(tmp_path / "results")
    assert write_numbers(numbers) == write_numbers(numbers_of(tmp_path / "results"))
    assert numbers["value"].between(numbers["low"], numbers["high"]).all()
    assert (numbers["low"] < numbers["high"]).any()


def test_the_interval_of_a_mean_is_as_wide_as_theory_says() -> None:
    generator = np.random.default_rng(3)
    values = generator.normal(10, 2, 400)
    resamples = generator.integers(400, size=(2000, 400))
    low, high = bootstrap_interval(values, statistic_of("error_r_deg"), resamples)
    assert high - low == pytest.approx(2 * 1.96 * values.std() / 20, rel=0.1)
    assert low < 10 < high


def test_results_csv_has_the_agreed_columns_and_reads_back(everything: pd.DataFrame) -> None:
    text = write_numbers(everything)
    columns = "table,scenario,subset,method,setting,metric,value,low,high,paper,pairs,failures"
    assert text.splitlines()[0] == columns
    assert "\r" not in text
    read = pd.read_csv(io.StringIO(text), dtype={"table": str})
    written = everything.assign(setting=everything["written"])[COLUMNS]
    pd.testing.assert_frame_equal(read, written, check_dtype=False)
    key = ["table", "scenario", "subset", "method", "setting", "metric"]
    assert not read.duplicated(key).any()
    pd.testing.assert_frame_equal(read, read.sort_values(key, ignore_index=True))


def test_a_setting_says_its_draw_its_bin_or_its_contrast(everything: pd.DataFrame) -> None:
    written = {*everything["written"]}
    assert {
        "steps=2,sampler=ddim,draw=1",
        "steps=2,sampler=ddim minus steps=1,sampler=ddpm",
        "paper minus icp_centroid:paper",
        "fusion=concat minus constant:paper",
        "rotation_deg=30-45",
    } <= written


def test_what_a_setting_varies_has_columns_of_its_own(everything: pd.DataFrame) -> None:
    row = pick(everything, written="steps=2,sampler=ddim,draw=1", metric="error_t",
               method="pcrdiffusion_cf")  # fmt: skip
    assert tuple(row[["ablation", "setting", "steps", "sampler", "draw", "kind"]]) == (
        "steps", "steps=2,sampler=ddim", "2", "ddim", 1, "draw"
    )  # fmt: skip
    binned = choose(everything, kind="bin")
    assert (binned["bin_high"] - binned["bin_low"] == 15).all()
    assert {*everything["kind"]} == {"line", "bin", "draw", "contrast"}


def test_steps_stand_in_table_7_beside_the_papers_numbers(everything: pd.DataFrame) -> None:
    named = {"table": "7", "method": "pcrdiffusion_cf", "metric": "error_r_deg", "subset": "all"}
    assert pick(everything, written="steps=2,sampler=ddpm", **named)["paper"] == 3.1962
    assert np.isnan(pick(everything, written="steps=2,sampler=ddim", **named)["paper"])


def test_the_spread_over_draws_is_the_deviation_of_their_means(everything: pd.DataFrame) -> None:
    named = {"table": "7", "method": "pcrdiffusion_cf", "setting": "steps=2,sampler=ddpm"}
    means = choose(everything, metric="error_r_deg", subset="all", **named)
    means = means.loc[means["kind"] != "contrast", "value"]
    assert len(means) == 3
    row = pick(spread_over_draws(everything), **named)
    assert row["value"] == pytest.approx(np.std(means, ddof=1))
    assert row["low"] < row["value"] < row["high"]
    assert (row["metric"], row["draw"], row["kind"]) == (SPREAD, 0, "line")
    assert SPREAD not in {*everything["metric"]}


def test_the_interval_of_a_spread_covers_as_often_as_it_says() -> None:
    means = np.random.default_rng(4).normal(5, 2, (2000, 4))
    place = {"table": "7", "ablation": "steps", "scenario": UNSEEN, "subset": "all", "paper": 0.0}
    place |= {"metric": "error_r_deg", "setting": "steps=1", "low": 0.0, "high": 0.0}
    draws = pd.DataFrame(
        [
            {**place, "method": str(k), "draw": draw, "kind": "draw", "value": value}
            for k, four in enumerate(means)
            for draw, value in enumerate(four)
        ]
    )
    found = spread_over_draws(draws)
    covered = (found["low"] < 2.0) & (found["high"] > 2.0)
    assert len(found) == 2000
    assert covered.mean() == pytest.approx(0.95, abs=0.015)


def test_table_6_repeats_the_accuracy_of_what_was_timed(everything: pd.DataFrame) -> None:
    cb = choose(everything, table="6", method="pcrdiffusion_cb", kind="line").set_index("metric")
    main = choose(everything, table="1a", method="pcrdiffusion_cb", subset="all", kind="line")
    main = main.set_index("metric")
    names = ["value", "low", "high", "paper", "pairs", "failures"]
    for metric in ("mae_r_deg", "mae_t", "error_r_deg", "error_t"):
        assert cb.loc[metric, names].tolist() == main.loc[metric, names].tolist()
    assert cb["pairs"].to_dict()["seconds"] == 5
    assert cb["paper"].to_dict()["seconds"] == 0.0986
    assert {*cb.index} >= {"seconds", "peak_memory_mib"}


def test_a_contrast_is_the_mean_of_paired_differences(tmp_path: Path) -> None:
    for method, errors in (("pcrdiffusion_cb", (1.0, 2.0, 3.0)), ("fgr", (2.0, 3.0, 4.0))):
        rows = [plain_row(pair, off_deg=error) for pair, error in enumerate(errors)]
        write_rows(result_file(tmp_path, "kitti", method), rows)
    found = choose(numbers_of(tmp_path), written="paper minus fgr:paper")
    row = pick(found, metric="error_r_deg")
    assert tuple(row[["value", "low", "high"]]) == (-2.0, -2.0, -2.0)  # pairs differ, not methods
    assert tuple(row[["table", "kind", "base_method"]]) == ("2", "contrast", "fgr")
    assert np.isnan(row["paper"])
    improvement = pick(found, metric="improvement_percent")
    assert improvement["value"] == pytest.approx(100 / 3, rel=1e-5)
    assert improvement["low"] < improvement["value"] < improvement["high"]


def test_no_improvement_is_told_over_a_method_that_errs_nowhere(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", "pcrdiffusion_cb"), [plain_row(0, off_deg=1.0)])
    write_rows(result_file(tmp_path, "kitti", "fgr"), [plain_row(0)])
    assert "improvement_percent" not in {*numbers_of(tmp_path)["metric"]}


def test_one_line_of_each_method_is_its_headline(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(0, off_deg=1.0) | {"setting": "official"}]
    write_rows(result_file(tmp_path, UNSEEN, "rpmnet"), rows)
    write_rows(result_file(tmp_path, "kitti", "rpmnet"), rows[1:])
    main = choose(numbers_of(tmp_path), headline=True, metric="error_t", subset="all")
    assert main.set_index("scenario")["setting"].to_dict() == {UNSEEN: "paper", "kitti": "official"}


def test_the_authors_own_settings_stand_beside_the_same_number(tmp_path: Path) -> None:
    rows = [plain_row(0) | {"setting": setting} for setting in ("paper", "official")]
    write_rows(result_file(tmp_path, UNSEEN, "rpmnet"), rows)
    found = choose(numbers_of(tmp_path), metric="error_r_deg", subset="all")
    assert found["paper"].tolist() == [2.9619, 2.9619]


def judged_answers(folder: Path, probabilities: list[float], off_deg: list[float]) -> pd.DataFrame:
    """The numbers of answers that are off by so much, judged by a verdict that trusts from 0.8 on."""
    rows = [
        judged(plain_row(k, off_deg=off), p)
        for k, (p, off) in enumerate(zip(probabilities, off_deg, strict=True))
    ]
    write_rows(result_file(folder, UNSEEN, VERIFIED), rows)
    verdicts = {(UNSEEN, VERIFIED, "paper"): verdict_from(0.8)}
    answers, times = read_answers(folder, verdicts), read_times(folder)
    return make_numbers(answers, times, measure_difficulty({}), seed=0)


def test_trust_is_worked_by_hand_over_the_answers_with_a_probability(tmp_path: Path) -> None:
    # an error is twice what each angle is off by
    probabilities, off_deg = [0.9, 0.9, 0.9, 0.5, 0.1], [0.1, 0.1, 9.0, 0.1, 9.0]
    numbers = judged_answers(tmp_path, probabilities, off_deg)
    rows = choose(numbers, kind="trust").set_index("metric")
    error = 100 * (3 * abs(0.9 - 2 / 3) + 0.5 + 0.1) / 5
    assert rows["value"].to_dict() == pytest.approx(
        {
            "right_percent": 60.0,
            "trusted_percent": 60.0,
            "wrong_of_trusted_percent": 100 / 3,
            "trusted_of_right_percent": 200 / 3,
            "calibration_error_percent": error,
        },
        rel=1e-5,
    )
    assert {*rows["pairs"]} == {5}
    sure = rows.drop("calibration_error_percent")
    assert (sure["low"] < sure["value"]).all()
    assert (sure["value"] < sure["high"]).all()
    assert rows.loc["calibration_error_percent", ["low", "high"]].isna().all()


def test_answers_without_a_probability_have_no_trust(everything: pd.DataFrame) -> None:
    assert not len(choose(everything, kind="trust"))


def test_an_answer_far_off_in_translation_is_wrong(tmp_path: Path) -> None:
    write_rows(
        result_file(tmp_path, UNSEEN, "icp"), [plain_row(0, shift=0.03), plain_row(1, shift=0.04)]
    )
    assert read_answers(tmp_path)["right"].tolist() == [True, False]
