"""Pairs to look at: which are chosen, and that poses put clouds where methods put them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.formats.walks import RecordedWalk
from pipeline.reporting.clouds import (
    Example,
    choose_examples,
    choose_pairs,
    describe,
    errors,
    known_pair,
    scene_data,
    thin,
)
from pipeline.reporting.reading import PairFile, read_answers, read_pair_files
from tests.pipeline.reporting.synthetic_results import write_everything

SCENARIOS = ("modelnet40-unseen_objects", "3dmatch")
Inputs = tuple[pd.DataFrame, dict[str, PairFile], list[Example]]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, SCENARIOS, 6)
    answers = read_answers(folder / "results")
    files = read_pair_files(folder / "pairs", SCENARIOS)
    return answers, files, choose_examples(answers, files)


def read_kitti(folder: Path, pairs: int = 3) -> PairFile:
    write_everything(folder, ("kitti",), pairs)
    return read_pair_files(folder / "pairs", ["kitti"])["kitti"]


def walk_to(end: np.ndarray) -> RecordedWalk:
    return RecordedWalk(
        "pcrdiffusion_cb", 1, (1000, 500), np.stack([np.eye(4)] * 2), np.stack([end] * 2)
    )


def test_examples_are_the_pairs_of_best_median_and_worst_error(inputs: Inputs) -> None:
    answers, _, examples = inputs
    assert [(one.scenario, one.choice) for one in examples] == [
        (scenario, choice) for scenario in SCENARIOS for choice in ("best", "median", "worst")
    ]
    cb = answers[answers["headline"] & (answers["method"] == "pcrdiffusion_cb")]
    cb = cb[cb["scenario"] == SCENARIOS[0]].set_index("pair")["error_r_deg"]
    found = [cb[example.pair] for example in examples[:3]]
    assert found == [np.sort(cb)[i] for i in (0, 2, 5)]
    for example in examples[:3]:
        assert example.answers["error_r_deg"].iloc[0] == cb[example.pair]
        assert example.answers["method"].tolist() == [
            "pcrdiffusion_cb",
            "identity",
            "constant",
            "icp_centroid",
            "icp",
            "fgr",
            "pcrdiffusion_cf",
        ]


def test_of_pairs_with_equal_errors_the_first_is_chosen() -> None:
    answers = pd.DataFrame({"pair": [4, 5, 6, 7], "error_r_deg": [2.0, 1.0, 1.0, 2.0]})
    assert choose_pairs(answers) == {"best": 5, "median": 6, "worst": 7}


def test_without_ours_the_last_method_chooses(inputs: Inputs) -> None:
    answers, files, _ = inputs
    floors = answers[answers["method"].isin(["identity", "constant"])]
    assert choose_examples(floors, files)[0].answers["method"].tolist() == ["constant", "identity"]


def test_a_true_pose_lays_the_source_on_the_target(tmp_path: Path) -> None:
    file = read_kitti(tmp_path)
    answers = read_answers(tmp_path / "results")
    exact = answers[answers["method"] == "icp_centroid"]
    example = choose_examples(exact, {"kitti": file})[0]
    answer = example.answers.iloc[0].to_dict()
    np.testing.assert_allclose(example.registered(answer), example.target, atol=1e-4)
    assert not np.allclose(example.source, example.target, atol=1e-1)
    assert describe(answer, "m") == (
        "ICP from the centroids: rotation off by 0°, translation by 0 (m)"
    )
    assert describe(answer | {"failed": True}, "m").endswith("(failed: identity pose shown)")


def test_poses_of_the_page_move_the_source_where_the_method_put_it(inputs: Inputs) -> None:
    _, files, examples = inputs
    scenes = scene_data(examples, {}, files)
    worst = examples[-1]
    pose = scenes["examples"]["3dmatch"]["worst"]["poses"]["icp"]["pose"]
    source = np.array(scenes["clouds"][f"3dmatch/{worst.pair}"]["source"])
    T = np.array(pose).reshape(3, 4)
    icp = worst.answers[worst.answers["method"] == "icp"].iloc[0].to_dict()
    moved = (T[:, :3] @ source).T + T[:, 3]
    np.testing.assert_allclose(moved, worst.registered(icp), atol=5e-3)


def test_a_walk_that_ends_at_the_truth_is_off_by_nothing(tmp_path: Path) -> None:
    files = {"kitti": read_kitti(tmp_path)}
    _, _, truth = known_pair(files["kitti"], 1)
    scenes = scene_data([], {"kitti": [walk_to(truth)]}, files)
    (walk,) = scenes["walks"]["kitti"]
    assert walk["predicted"][-1]["off"] == [0, 0]
    assert walk["noisy"][0]["off"][1] == pytest.approx(np.linalg.norm(truth[:3, 3]), rel=1e-2)
    assert walk["group"] == "bottle"
    assert [*scenes["clouds"]] == ["kitti/1"]


def test_the_error_of_a_pose_is_in_degrees_and_the_clouds_unit() -> None:
    quarter = np.array([[0.0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert errors(quarter[None], np.eye(4)) == [[90.0, 5.0]]


def test_a_walked_pair_must_be_there(tmp_path: Path) -> None:
    file = read_kitti(tmp_path, 1)
    with pytest.raises(ValueError, match="kitti needs a test pair 1, it has 1"):
        scene_data([], {"kitti": [walk_to(np.eye(4))]}, {"kitti": file})


def test_thinning_keeps_few_points_from_first_to_last() -> None:
    points = np.arange(30000.0).reshape(-1, 3)
    few = thin(points, 100)
    assert len(few) == 100
    assert few[0, 0] == 0
    assert few[-1, -1] == 29999
    assert len(thin(points[:7], 100)) == 7
