"""3DMatch's fragments and pairs: what is read, what is refused, and that the poses fit."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from pcrdiff.datasets.threedmatch import read_fragment, read_items, read_recorded_pairs
from tests.pcrdiff.clouds.no_numbers import NO_NUMBERS

SCENE = "7-scenes-redkitchen"


def write_fragment(path: Path, points: np.ndarray, announced: int | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points) if announced is None else announced}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def make_pose(seed: int) -> np.ndarray:
    T_target_source = np.eye(4)
    T_target_source[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    T_target_source[:3, 3] = [0.5, 0.25, seed]
    return T_target_source


def write_log(root: Path, *blocks: tuple[str, np.ndarray]) -> Path:
    path = root / f"{SCENE}-evaluation" / "gt.log"
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = ["\t".join(f"{value: .8e}" for value in row) for _, pose in blocks for row in pose]
    lines = [
        line
        for index, (header, _) in enumerate(blocks)
        for line in (header, *rows[4 * index : 4 * index + 4])
    ]
    path.write_text("\t \n".join(lines) + "\n")
    return path


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    points = np.random.default_rng(0).random((6, 3))
    for number in (0, 1, 2, 10):
        write_fragment(tmp_path / SCENE / f"cloud_bin_{number}.ply", points + number)
    write_fragment(tmp_path / "another" / "cloud_bin_0.ply", points)
    write_log(tmp_path, ("0\t 1\t 11", make_pose(1)), ("1\t 10\t 11", make_pose(2)))
    return tmp_path


def test_lists_fragments_scene_by_scene_in_numeric_order(scenes: Path) -> None:
    write_fragment(scenes / f"{SCENE}-evaluation" / "cloud_bin_0.ply", np.zeros((1, 3)))
    items = read_items(scenes)
    assert [item.name for item in items] == [
        f"{SCENE}/cloud_bin_0",
        f"{SCENE}/cloud_bin_1",
        f"{SCENE}/cloud_bin_2",
        f"{SCENE}/cloud_bin_10",
        "another/cloud_bin_0",
    ]
    assert {item.split for item in items} == {None}
    assert items[-1].group == "another"


def test_reads_points_in_float64(scenes: Path) -> None:
    cloud = read_items(scenes)[0].read()
    assert isinstance(cloud, np.ndarray)
    assert cloud.dtype == np.float64
    np.testing.assert_allclose(cloud, np.random.default_rng(0).random((6, 3)), atol=1e-7)


def test_reads_a_block_i_j_as_the_pose_from_j_to_i(scenes: Path) -> None:
    first, second = read_recorded_pairs(scenes)
    assert (first.source, first.target) == (f"{SCENE}/cloud_bin_1", f"{SCENE}/cloud_bin_0")
    assert (second.source, second.target) == (f"{SCENE}/cloud_bin_10", f"{SCENE}/cloud_bin_1")
    assert first.group == SCENE
    np.testing.assert_allclose(first.T_target_source, make_pose(1), atol=1e-8)


def test_refuses_a_folder_without_fragments_or_logs(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="gone is not one"):
        read_items(tmp_path / "gone")
    with pytest.raises(FileNotFoundError, match="holds no fragment"):
        read_items(tmp_path)
    with pytest.raises(FileNotFoundError, match="holds none"):
        read_recorded_pairs(tmp_path)
    (tmp_path / f"{SCENE}-evaluation").mkdir()
    with pytest.raises(FileNotFoundError, match=r"gt\.log, which is missing"):
        read_recorded_pairs(tmp_path)


def test_refuses_a_cut_fragment_when_it_is_read(scenes: Path) -> None:
    write_fragment(scenes / SCENE / "cloud_bin_0.ply", np.zeros((5, 3)), announced=9)
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs the 9 points"):
        read_items(scenes)[0].read()


def test_refuses_a_log_cut_anywhere_but_between_blocks(scenes: Path) -> None:
    path = scenes / f"{SCENE}-evaluation" / "gt.log"
    lines = path.read_text().splitlines(keepends=True)
    for kept in (*range(5), *range(6, 10)):
        path.write_text("".join(lines[:kept]))
        with pytest.raises(ValueError, match=r"gt\.log needs blocks of 5 lines"):
            read_recorded_pairs(scenes)
    path.write_text("".join(lines[:8]) + "0.5 0.5\n" + lines[9])
    with pytest.raises(ValueError, match=r"gt\.log, block '1 10 11', line 9, needs 4 numbers"):
        read_recorded_pairs(scenes)


def test_refuses_a_header_that_is_none_and_a_fragment_without_a_file(scenes: Path) -> None:
    write_log(scenes, ("0 one 11", make_pose(1)))
    with pytest.raises(ValueError, match="block '0 one 11', line 1, needs `i j n`"):
        read_recorded_pairs(scenes)
    write_log(scenes, ("0 7 11", make_pose(1)))
    with pytest.raises(FileNotFoundError, match=r"fragment 7, but .*cloud_bin_7\.ply is missing"):
        read_recorded_pairs(scenes)


def test_refuses_a_pose_that_is_not_rigid(scenes: Path) -> None:
    write_log(scenes, ("0 1 11", make_pose(1) @ np.diag([1.1, 1.1, 1.1, 1])))
    with pytest.raises(ValueError, match="block '0 1 11', needs a rigid pose"):
        read_recorded_pairs(scenes)


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_refuses_a_pose_with_what_is_no_finite_number(scenes: Path, word: str) -> None:
    path = scenes / f"{SCENE}-evaluation" / "gt.log"
    lines = path.read_text().splitlines()
    row = [*lines[7].split()[:3], word]
    path.write_text("\n".join([*lines[:7], "\t".join(row), *lines[8:]]))
    with pytest.raises(ValueError, match=r"gt\.log, block '1 10 11', line 8, .*finite") as refused:
        read_recorded_pairs(scenes)
    assert repr(word) in str(refused.value)


def test_refuses_a_log_in_latin1_and_a_number_of_thousands_of_digits(scenes: Path) -> None:
    path = write_log(scenes, ("0 1 11 \xe9", make_pose(1)))
    path.write_bytes(path.read_text().encode("latin-1"))
    with pytest.raises(ValueError, match=r"gt\.log, line 1, .*UTF-8.*0xe9.*Latin-1"):
        read_recorded_pairs(scenes)
    write_log(scenes, (f"0 {'1' * 5000} 11", make_pose(1)))
    with pytest.raises(ValueError, match=r"gt\.log, block .* line 1, needs `i j n`"):
        read_recorded_pairs(scenes)


@pytest.mark.real
def test_reads_every_real_fragment_and_pair(real_data: Path) -> None:
    items, pairs = read_items(real_data / "3dmatch"), read_recorded_pairs(real_data / "3dmatch")
    assert (len(items), len(pairs)) == (235, 1096)
    assert len({item.group for item in items}) == 4
    assert {pair.source for pair in pairs} | {pair.target for pair in pairs} <= {
        item.name for item in items
    }


def thin(cloud: np.ndarray, cell: float) -> np.ndarray:
    """Keep one point per cell of a grid."""
    return cloud[np.unique(np.floor(cloud / cell), axis=0, return_index=True)[1]]


def measure_overlap(source: np.ndarray, target: KDTree, T_target_source: np.ndarray) -> float:
    """Give the share of the source's points with a target point within 7.5 cm."""
    moved = source @ T_target_source[:3, :3].T + T_target_source[:3, 3]
    return float(np.isfinite(target.query(moved, distance_upper_bound=0.075)[0]).mean())


@pytest.mark.real
def test_the_recorded_poses_lay_real_fragments_onto_each_other(real_data: Path) -> None:
    clouds = {
        item.name: thin(np.asarray(item.read()), 0.05) for item in read_items(real_data / "3dmatch")
    }
    trees = {name: KDTree(cloud) for name, cloud in clouds.items()}
    right, inverted, unmoved = [], [], []
    for pair in read_recorded_pairs(real_data / "3dmatch"):
        source, target = clouds[pair.source][::5], trees[pair.target]
        right.append(measure_overlap(source, target, pair.T_target_source))
        inverted.append(measure_overlap(source, target, np.linalg.inv(pair.T_target_source)))
        unmoved.append(measure_overlap(source, target, np.eye(4)))
    assert np.mean(right) > 0.5
    assert np.mean(unmoved) < 0.2
    assert np.mean(np.array(right) > unmoved) > 0.99
    assert (np.array(right) > inverted).all()


def test_a_fragment_reaches_no_kilometre_its_numbers_would_be_of_another_type(
    tmp_path: Path,
) -> None:
    path = tmp_path / "cloud_bin_0.ply"
    write_fragment(path, np.array([[0.0, 0, 1000], [0, 0, 1]]))
    with pytest.raises(ValueError, match="coordinates below 1000"):
        read_fragment(path)
