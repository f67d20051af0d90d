"""How hard pairs are: worked by hand, and sorted into bins."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from scipy.spatial.transform import Rotation

from pcrdiff.registration import Pairs
from pipeline.reporting.difficulty import bin_pairs, measure_difficulty, overlap, rotation_deg
from pipeline.reporting.numbers import make_numbers
from pipeline.reporting.reading import read_answers, read_pair_files, read_times
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)

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


def edges(by: str, values: list[float]) -> list[tuple[float, float]]:
    found = bin_pairs(UNSEEN, by, np.array(values))
    assert found["pair"].tolist() == [*range(len(values))]
    return [*zip(found["bin_low"], found["bin_high"], strict=True)]


def test_a_bin_holds_what_lies_between_its_edges() -> None:
    assert edges("rotation_deg", [0.0, 14.9, 15.0, 29.9, 31.0, 180.0]) == [
        (0, 15), (0, 15), (15, 30), (15, 30), (30, 45), (165, 180)
    ]  # fmt: skip


def test_full_overlap_and_edges_of_tenths_fall_where_they_belong() -> None:
    found = np.array(edges("overlap", [1.0, 0.9, 0.95, 0.3, 0.399]))
    np.testing.assert_allclose(found[:, 0], [0.9, 0.9, 0.9, 0.3, 0.3])
    np.testing.assert_allclose(found[:, 1], [1.0, 1.0, 1.0, 0.4, 0.4])


def binned(folder: Path, pairs: list[int], values: list[float]) -> pd.DataFrame:
    """The bins of one method's numbers on pairs so difficult."""
    write_rows(result_file(folder, UNSEEN, "icp"), [plain_row(pair) for pair in pairs])
    difficulty = bin_pairs(UNSEEN, "rotation_deg", np.array(values))
    numbers = make_numbers(read_answers(folder), read_times(folder), difficulty, seed=0)
    found = numbers[(numbers["kind"] == "bin") & (numbers["metric"] == "error_r_deg")]
    return found.set_index("written")["pairs"]


def test_small_bins_are_left_out(tmp_path: Path) -> None:
    values = [0.0, 1, 2, 3, 14.9, 15, 16, 17, 18, 19, 20, 31, 32]
    found = binned(tmp_path, [*range(13)], values)
    assert found.to_dict() == {"rotation_deg=0-15": 5, "rotation_deg=15-30": 6}


def test_bins_are_of_the_pairs_that_were_answered(tmp_path: Path) -> None:
    found = binned(tmp_path, [1, 3, 4, 5, 6, 7], [50.0, 1, 50, 1, 50, 1, 1, 1])
    assert found.to_dict() == {"rotation_deg=0-15": 5}


def test_measures_angles_of_unseen_objects_and_overlap_of_partial_clouds(tmp_path: Path) -> None:
    write_everything(tmp_path, (UNSEEN, "modelnet40-partial", "kitti"), 3)
    files = read_pair_files(tmp_path / "pairs", [UNSEEN, "modelnet40-partial", "kitti"])
    found = measure_difficulty(files).set_index("scenario")
    assert {*found.loc[UNSEEN, "by"]} == {"rotation_deg"}
    assert {*found.loc["modelnet40-partial", "by"]} == {"overlap"}
    assert (found.loc["modelnet40-partial", "bin_high"] == 1).all()  # its clouds are not cropped
    assert measure_difficulty({"kitti": files["kitti"]}).empty
    with pytest.raises(FileNotFoundError):
        read_pair_files(tmp_path, [UNSEEN])
