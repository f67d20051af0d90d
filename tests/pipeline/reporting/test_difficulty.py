"""How hard pairs are: worked by hand, and sorted into bins."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from pcrdiff.registration import Pairs
from pipeline.reporting.background import read_pair_files
from pipeline.reporting.difficulty import Difficulty, measure_difficulties, overlap, rotation_deg
from tests.pipeline.reporting.made_up_results import write_everything

UNSEEN = "modelnet40-unseen_objects"


def pairs(source: np.ndarray, target: np.ndarray, pose: np.ndarray) -> Pairs:
    return Pairs(
        torch.from_numpy(source.astype(np.float32))[None],
        torch.from_numpy(target.astype(np.float32))[None],
        torch.from_numpy(pose)[None],
        torch.arange(1),
        ("chair",),
    )


@pytest.mark.parametrize("angle", [0.0, 1e-3, 33.0, 90.0, 179.999, 180.0])
def test_the_angle_of_a_rotation_is_the_one_it_was_made_with(angle: float) -> None:
    pose = np.eye(4)
    axis = np.array([2.0, -1.0, 2.0]) / 3
    pose[:3, :3] = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix()
    found = rotation_deg(pairs(np.zeros((1, 3)), np.zeros((1, 3)), pose))
    assert found[0] == pytest.approx(angle, abs=1e-4)


def test_the_overlap_is_the_share_of_points_that_find_a_neighbour_where_they_truly_lie() -> None:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    pose[:3, 3] = (1.0, 0.0, 0.0)
    source = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    target = source[:3] @ pose[:3, :3].T + pose[:3, 3]
    target[1, 2] += 0.049  # within reach of its partner, and
    target[2, 2] += 0.051  # just out of it
    assert overlap(pairs(source, target, pose))[0] == 0.5


def test_a_bin_holds_what_its_name_says_and_small_ones_are_left_out() -> None:
    values = np.array([0.0, 1, 2, 3, 14.9, 15, 16, 17, 18, 19, 20, 31, 32])
    bins = Difficulty(UNSEEN, "rotation_deg", values).bins(np.arange(13))
    assert {name: inside.tolist() for name, inside in bins.items()} == {
        "rotation_deg=0-15": [0, 1, 2, 3, 4],
        "rotation_deg=15-30": [5, 6, 7, 8, 9, 10],
    }


def test_bins_are_of_the_pairs_that_were_answered() -> None:
    difficulty = Difficulty(UNSEEN, "rotation_deg", np.array([50.0, 1, 50, 1, 50, 1, 1, 1]))
    (found,) = difficulty.bins(np.array([1, 3, 4, 5, 6, 7])).items()
    assert found[0] == "rotation_deg=0-15"
    assert found[1].tolist() == [0, 1, 3, 4, 5]  # places among the answered


def test_full_overlap_and_edges_of_tenths_fall_where_they_belong() -> None:
    values = np.array([1.0, 1.0, 0.9, 0.95, 0.99, 0.3, 0.3, 0.3, 0.3, 0.399])
    bins = Difficulty("modelnet40-partial", "overlap", values).bins(np.arange(10))
    assert {name: len(inside) for name, inside in bins.items()} == {
        "overlap=0.3-0.4": 5,
        "overlap=0.9-1": 5,
    }


def test_measures_angles_of_unseen_objects_and_overlap_of_partial_clouds(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN, "modelnet40-partial", "kitti"), 3)
    files = read_pair_files(tmp_path / "pairs", [UNSEEN, "modelnet40-partial", "kitti"])
    found = measure_difficulties(files)
    assert [(one.scenario, one.name) for one in found] == [
        (UNSEEN, "rotation_deg"),
        ("modelnet40-partial", "overlap"),
    ]
    assert (found[1].values == 1).all()  # made-up clouds are not cropped
    assert measure_difficulties({"kitti": files["kitti"]}) == []
    with pytest.raises(FileNotFoundError):
        read_pair_files(tmp_path, [UNSEEN])
