"""Result files are believed only when they are whole."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from pipeline.formats.answers import JUDGED
from pipeline.formats.pairs import read_pairs
from pipeline.reporting.clouds import pose_of
from pipeline.reporting.reading import (
    read_all_verdicts,
    read_all_walks,
    read_answers,
    read_pair_files,
    read_shipped,
    read_times,
    read_trainings,
)
from tests.pipeline.reporting.synthetic_results import (
    ROTATION_ERROR_DEG,
    VERIFIED,
    judged,
    plain_row,
    result_file,
    verdict_from,
    write_everything,
    write_rows,
    write_verified,
)

FILE = "icp/modelnet40-unseen_objects.csv"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_rows(tmp_path / FILE, [plain_row(pair, off_deg=1.25) for pair in range(3)])


def test_reads_rows_in_the_order_of_the_pairs(tmp_path: Path) -> None:
    rows = [plain_row(pair, off_deg=float(pair)) for pair in (2, 0, 1)]
    write_rows(tmp_path / FILE, rows)
    answers = read_answers(tmp_path)
    assert answers["pair"].tolist() == [0, 1, 2]
    assert answers["rx_deg"].tolist() == [0.0, 1.0, 2.0]
    for answer in answers.to_dict("records"):
        np.testing.assert_array_equal(pose_of(answer), np.eye(4))


def test_keeps_settings_of_one_file_apart(tmp_path: Path) -> None:
    rows = [plain_row(0), plain_row(0, off_deg=1.0) | {"setting": "official"}]
    write_rows(tmp_path / FILE, rows)
    assert read_answers(tmp_path)["setting"].tolist() == ["official", "paper"]


def test_a_failure_with_a_comma_and_quotes_is_a_failure(tmp_path: Path) -> None:
    rows = [plain_row(0) | {"failure": 'fgr needs 3 matches, got "none"'}, plain_row(1)]
    write_rows(tmp_path / FILE, rows)
    assert read_answers(tmp_path)["failed"].tolist() == [True, False]


def test_refuses_an_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="found none"):
        read_answers(tmp_path)


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.5, 0.9, 0.999])
def test_refuses_a_file_cut_anywhere_in_a_line(file: Path, kept: float) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ValueError, match=r"unseen_objects\.csv needs"):
        read_answers(file.parents[1])


def test_refuses_a_file_cut_between_lines_when_a_neighbour_has_more(file: Path) -> None:
    write_rows(file.parents[1] / "fgr" / file.name, [plain_row(pair) for pair in range(2)])
    with pytest.raises(ValueError, match=r"fgr/\S+\.csv needs all 3 pairs .* has 2"):
        read_answers(file.parents[1])


def test_refuses_a_pair_twice(tmp_path: Path) -> None:
    write_rows(tmp_path / FILE, [plain_row(0), plain_row(0)])
    with pytest.raises(ValueError, match=r"unseen_objects\.csv .* pair 0 twice"):
        read_answers(tmp_path)


def test_probabilities_are_read_with_the_trust_that_their_verdict_has_in_them(
    tmp_path: Path,
) -> None:
    write_verified(tmp_path, "kitti", 8)
    write_rows(tmp_path / "icp/kitti.csv", [plain_row(pair) for pair in range(8)])
    verdicts = read_all_verdicts(tmp_path)
    assert [*verdicts] == [("kitti", VERIFIED, "fast"), ("kitti", VERIFIED, "official")]
    answers = read_answers(tmp_path, verdicts).set_index(["method", "setting"])
    assert answers.loc["icp", "probability"].isna().all()
    assert not answers.loc["icp", "trusted"].any()
    assert not answers.loc[(VERIFIED, "fast"), "trusted"].any()
    official = answers.loc[(VERIFIED, "official")]
    assert ((official["probability"] >= 0.25) == official["trusted"]).all()
    assert official["trusted"].nunique() == 2
    assert (official["sharpness"] == 0.5).all()


def test_verdicts_of_weights_that_came_with_the_code_are_read_too(tmp_path: Path) -> None:
    write_verified(tmp_path / "shipped", "kitti", 8)
    verdicts = read_all_verdicts(tmp_path)
    assert len(verdicts) == 2
    assert read_answers(tmp_path, verdicts)["trusted"].any()
    assert read_shipped(tmp_path) == []


def test_refuses_probabilities_without_their_verdict(tmp_path: Path) -> None:
    write_verified(tmp_path, "kitti", 3)
    with pytest.raises(ValueError, match=r"kitti\.csv needs the verdict that its probabilities of"):
        read_answers(tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [("1.5", r"needs probabilities in \[0, 1\]"), ("sure", "needs a finite number in column prob")],
)
def test_refuses_what_is_no_probability(tmp_path: Path, text: str, said: str) -> None:
    row = judged(plain_row(0), 0.5) | {"probability": text}
    write_rows(tmp_path / VERIFIED / "kitti.csv", [row])
    with pytest.raises(ValueError, match=rf"kitti\.csv {said}"):
        read_answers(tmp_path, {("kitti", VERIFIED, "paper"): verdict_from(0.5)})


def test_a_failure_is_never_right_nor_trusted(tmp_path: Path) -> None:
    failed = judged(plain_row(0), 0.5) | dict.fromkeys(JUDGED, "") | {"failure": "no"}
    write_rows(tmp_path / VERIFIED / "kitti.csv", [failed, judged(plain_row(1), 0.5)])
    answers = read_answers(tmp_path, {("kitti", VERIFIED, "paper"): verdict_from(0.0)})
    assert answers["right"].tolist() == answers["trusted"].tolist() == [False, True]


@pytest.mark.parametrize("text", ["nan", "inf", "", "one"])
def test_refuses_what_is_no_finite_number(tmp_path: Path, text: str) -> None:
    write_rows(tmp_path / FILE, [plain_row(0) | {"error_t": text}])
    with pytest.raises(
        ValueError, match=r"unseen_objects\.csv needs a finite number in column error_t"
    ):
        read_answers(tmp_path)


def test_refuses_missing_and_unknown_columns(tmp_path: Path) -> None:
    row = plain_row(0)
    del row["ty"]
    write_rows(tmp_path / FILE, [row])
    with pytest.raises(ValueError, match=r"unseen_objects\.csv needs the columns ty"):
        read_answers(tmp_path)
    write_rows(tmp_path / FILE, [plain_row(0) | {"colour": "red"}])
    with pytest.raises(
        ValueError, match=r"unseen_objects\.csv has columns nobody here reads: colour"
    ):
        read_answers(tmp_path)


def test_reads_trainings_and_leaves_gaps_where_nothing_was_validated(tmp_path: Path) -> None:
    write_everything(tmp_path, ("modelnet40-unseen_objects",), 2)
    first = read_trainings(tmp_path / "models")[0]
    assert first.budget["best_epoch"] == 28
    assert np.isnan(first.curve["val_error_r_deg"][0])
    assert first.curve["loss"].notna().all()


def test_reads_an_ablations_trainings_under_the_names_they_give(tmp_path: Path) -> None:
    write_everything(tmp_path, ("modelnet40-unseen_objects",), 2)
    trainings = read_trainings(tmp_path / "models")
    main = [one for one in trainings if not one.setting]
    assert [one.method for one in main] == ["pcrdiffusion_cb", "pcrdiffusion_cf"]
    ablated = {(one.method, one.setting): one for one in trainings if one.setting}
    assert len(ablated) == 4 + 12 + 3
    euler = ablated["pcrdiffusion_cb", "representation=euler,scaling=raw"]
    assert (euler.scenario, euler.budget["epochs"]) == ("modelnet40-unseen_objects", 6)
    assert len(euler.curve["loss"]) == 6


def test_reads_answers_of_weights_that_came_along_beside_the_others(tmp_path: Path) -> None:
    write_rows(tmp_path / FILE, [plain_row(0)])
    shipped = tmp_path / "shipped" / FILE
    write_rows(shipped, [plain_row(0, off_deg=1.0) | {"setting": "shipped"}])
    facts = {"method": "fgr", "epochs": 7, "data": {"source": "local"}}
    shipped.with_suffix(".json").write_text(json.dumps(facts), encoding="utf-8")
    answers = read_answers(tmp_path)
    assert answers["setting"].tolist() == ["paper", "shipped"]
    assert answers["headline"].tolist() == [True, False]
    assert answers["method"].nunique() == 1
    (training,) = read_shipped(tmp_path)
    assert (training.setting, training.budget["epochs"]) == ("shipped", 7)
    assert training.scenario == shipped.stem
    assert len(training.curve) == 0


def test_reads_trainings_at_any_depth_and_believes_the_names_in_them(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "baselines" / "pcrnet" / "kitti"
    folder.mkdir(parents=True)
    (folder / "facts.json").write_text('{"scenario": "kitti", "method": "pcrnet", "epochs": 3}')
    (one,) = read_trainings(tmp_path)
    assert (one.scenario, one.method, one.setting) == ("kitti", "pcrnet", "")
    assert one.curve.empty
    assert one.budget["epochs"] == 3
    (folder / "facts.json").write_text('{"scenario": "kitti", "epochs": 3}')
    with pytest.raises(ValueError, match=r"facts\.json needs the names of scenario, method, has"):
        read_trainings(tmp_path)


def test_refuses_an_ablations_training_without_its_setting(tmp_path: Path) -> None:
    file = tmp_path / "ablations" / "fusion" / "concat" / "pcrdiffusion_cf" / "facts.json"
    file.parent.mkdir(parents=True)
    file.write_text('{"scenario": "kitti", "method": "pcrdiffusion_cf"}')
    with pytest.raises(
        ValueError,
        match=r"cf/facts\.json needs the names of its settings if of an ablation, has None",
    ):
        read_trainings(tmp_path)


def timed(pair: int = 0, **more: str) -> dict[str, object]:
    row = {"pair": pair, "setting": "paper", "seconds": "0.5", "peak_memory_mib": "12.0"}
    return row | more


def test_reads_times_and_leaves_them_and_walks_out_of_the_results(tmp_path: Path) -> None:
    write_everything(tmp_path, ("modelnet40-unseen_objects",), 7)
    answers, times = read_answers(tmp_path / "results"), read_times(tmp_path / "results")
    assert {*answers["scenario"]} == {"modelnet40-unseen_objects"}
    assert {*times["method"]} == {*ROTATION_ERROR_DEG}
    assert times.loc[times["method"] == "icp", "pair"].tolist() == [0, 1, 2, 3, 4]
    assert (times["peak_memory_mib"] > 30).all()


def test_no_times_are_no_fault(tmp_path: Path) -> None:
    assert read_times(tmp_path).empty
    assert read_all_walks(tmp_path) == {}


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([timed(), timed()], "pair 0 twice"),
        ([timed(seconds="0.0")], "times above zero"),
        ([timed(peak_memory_mib="-1.0")], "memory not below"),
        ([timed(seconds="soon")], "a finite number in column seconds"),
        ([timed() | {"colour": "red"}], r"icp\.csv has columns nobody here reads: colour"),
        ([{"pair": 0, "setting": "paper"}], r"icp\.csv needs the columns peak_memory_mib, seconds"),
    ],
)
def test_refuses_times_that_cannot_be(
    tmp_path: Path, rows: list[dict[str, object]], message: str
) -> None:
    write_rows(tmp_path / "times" / "icp.csv", rows)
    with pytest.raises(ValueError, match=message):
        read_times(tmp_path)


def test_headlines_are_of_the_papers_setting_where_there_is_one(tmp_path: Path) -> None:
    both = [plain_row(0), plain_row(0, off_deg=1.0) | {"setting": "official"}]
    write_rows(tmp_path / FILE, both)
    write_rows(result_file(tmp_path, "kitti", "gicp"), both[1:])
    write_rows(tmp_path / "ablations" / "steps.csv", [{"method": "icp", **both[0]}])
    answers = read_answers(tmp_path)
    found = answers[answers["headline"]].set_index(["scenario", "method"])["setting"]
    assert found.to_dict() == {
        ("modelnet40-unseen_objects", "icp"): "paper",
        ("kitti", "gicp"): "official",
    }


def test_refuses_a_budget_that_is_cut_short(tmp_path: Path) -> None:
    write_everything(tmp_path, ("modelnet40-unseen_objects",), 2)
    folder = tmp_path / "models" / "pcrdiffusion_cb" / "modelnet40-unseen_objects"
    file = folder / "facts.json"
    file.write_text(file.read_text()[:-5])
    with pytest.raises(ValueError, match=r"facts\.json needs a whole JSON object"):
        read_trainings(tmp_path / "models")


def test_says_which_pair_file_is_missing_or_broken(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"kitti\.h5"):
        read_pair_files(tmp_path, ["kitti"])
    (tmp_path / "kitti.h5").write_bytes(b"not HDF5")
    with pytest.raises(ValueError, match=r"kitti\.h5 is not a pair file"):
        read_pair_files(tmp_path, ["kitti"])


def test_a_pair_file_tells_what_it_is_and_gives_its_test_split(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti", "3dmatch"), 3)
    files = read_pair_files(tmp_path / "pairs", ["kitti", "kitti"])
    assert [*files] == ["kitti"]
    file = files["kitti"]
    assert (file.scenario, file.source, file.unit) == ("kitti", "synthetic", "m")
    assert (file.seed, file.schema, len(file.test)) == (7, 1, 3)
    assert file.provenance["max_rotation_deg"] == 45.0
    test = read_pairs(tmp_path / "pairs" / "kitti.h5", "test")
    torch.testing.assert_close(files["kitti"].test.source, test.source, rtol=0, atol=0)
    torch.testing.assert_close(files["kitti"].test.target, test.target, rtol=0, atol=0)


def test_further_draws_are_sets_of_their_own(tmp_path: Path) -> None:
    drawn = [plain_row(0) | {"setting": f"steps=2,sampler=ddpm{end}"} for end in ("", ",draw=7")]
    write_rows(tmp_path / "ablations" / "steps.csv", [{"method": "icp", **row} for row in drawn])
    answers = read_answers(tmp_path)
    assert answers["setting"].tolist() == ["steps=2,sampler=ddpm"] * 2
    assert answers["draw"].tolist() == [0, 7]
    assert {*answers["table"]} == {"7"}
    assert not answers["headline"].any()


def test_an_ablation_is_of_the_scenario_that_it_names(tmp_path: Path) -> None:
    row = {"method": "icp", "scenario": "kitti", **plain_row(0), "setting": "noise=0.1"}
    write_rows(tmp_path / "ablations" / "noise" / "icp.csv", [row])
    (answer,) = read_answers(tmp_path).to_dict("records")
    assert (answer["scenario"], answer["ablation"], answer["table"]) == ("kitti", "noise", "extra")
