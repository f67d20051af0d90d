"""The synthetic 3DMatch has the official layout, and its ground truth is true."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pcrdiff.bindings.open3d import open3d
from pipeline.synthetic.threedmatch import write_threedmatch

SCENES, FRAGMENTS, FRAMES = 2, 5, 2
NUMBER = r" ?-?\d\.\d{8}e[+-]\d\d"
PAIR = re.compile(r"\d+\t \d+\t \d+\t")
POSE_ROW = re.compile(rf"({NUMBER}\t ){{3}}{NUMBER}\t")
INFO_ROW = re.compile(rf"({NUMBER}\t ){{5}}{NUMBER}\t")

Pairs = dict[tuple[int, int], np.ndarray]


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("threedmatch")
    write_threedmatch(
        root, scenes=SCENES, fragments_per_scene=FRAGMENTS, frames_per_fragment=FRAMES, seed=7
    )
    return root


def scenes_of(root: Path) -> list[Path]:
    return sorted(p for p in root.iterdir() if not p.name.endswith("-evaluation"))


def evaluation_of(scene: Path) -> Path:
    return scene.with_name(f"{scene.name}-evaluation")


def read_cloud(scene: Path, index: int) -> np.ndarray:
    return np.asarray(open3d.io.read_point_cloud(scene / f"cloud_bin_{index}.ply").points)


def read_blocks(path: Path, rows: int) -> Pairs:
    """Read ``gt.log`` (4 rows) or ``gt.info`` (6 rows)."""
    lines = path.read_text().splitlines()
    blocks = {}
    for start in range(0, len(lines), rows + 1):
        i, j, _ = (int(field) for field in lines[start].split())
        blocks[i, j] = np.array(
            [line.split() for line in lines[start + 1 : start + 1 + rows]], float
        )
    return blocks


def read_pose(scene: Path, index: int) -> np.ndarray:
    return np.loadtxt(scene / f"cloud_bin_{index}.info.txt", skiprows=1)


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return min(share_near(a, b), share_near(b, a))


def share_near(target: np.ndarray, source: np.ndarray) -> float:
    distances = np.asarray(cKDTree(target).query(source, distance_upper_bound=0.05)[0])
    return float(np.isfinite(distances).mean())


def contents(root: Path) -> dict[str, bytes]:
    return {str(p.relative_to(root)): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def test_the_folders_and_files_are_named_as_the_official_ones(root: Path) -> None:
    scenes = scenes_of(root)
    assert len(scenes) == SCENES
    for scene in scenes:
        names = {f"cloud_bin_{n}{end}" for n in range(FRAGMENTS) for end in (".ply", ".info.txt")}
        assert {path.name for path in scene.iterdir()} == names
        assert {path.name for path in evaluation_of(scene).iterdir()} == {"gt.log", "gt.info"}


def test_a_fragment_is_a_binary_ply_of_float_xyz_that_open3d_reads(root: Path) -> None:
    for path in sorted(root.glob("*/*.ply")):
        header, body = path.read_bytes().split(b"end_header\n", 1)
        points = np.frombuffer(body, "<f4").reshape(-1, 3)
        assert header.decode().splitlines() == [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {len(points)}",
            *(f"property float {axis}" for axis in "xyz"),
        ]
        index = int(path.stem.removeprefix("cloud_bin_"))
        np.testing.assert_array_equal(read_cloud(path.parent, index), points)


def test_a_fragment_is_dense_without_being_crowded(root: Path) -> None:
    for scene in scenes_of(root):
        for index in range(FRAGMENTS):
            cloud = read_cloud(scene, index)
            assert 1_000 < len(cloud) < 30_000
            spacing = np.asarray(cKDTree(cloud).query(cloud, k=2)[0])[:, 1]
            assert 0.012 < np.median(spacing) < 0.03


def test_a_single_image_stays_in_the_field_of_view_and_range_of_its_camera(tmp_path: Path) -> None:
    write_threedmatch(tmp_path, scenes=1, fragments_per_scene=2, frames_per_fragment=1, seed=3)
    x, y, z = read_cloud(scenes_of(tmp_path)[0], 1).T
    assert z.min() >= 0.4
    assert z.max() <= 3.0 + 1e-6
    assert np.abs(x / z).max() <= 0.51
    assert np.abs(y / z).max() <= 0.38
    assert np.abs(x / z).max() > 0.45


@pytest.mark.parametrize(
    ("name", "row", "rows"), [("gt.log", POSE_ROW, 4), ("gt.info", INFO_ROW, 6)]
)
def test_the_pair_files_have_the_official_format(
    root: Path, name: str, row: re.Pattern[str], rows: int
) -> None:
    for scene in scenes_of(root):
        check_format((evaluation_of(scene) / name).read_text(), row, rows)


def check_format(text: str, row: re.Pattern[str], rows: int) -> None:
    lines = text.split("\n")
    assert lines.pop() == ""
    assert len(lines) % (rows + 1) == 0
    assert lines
    for number, line in enumerate(lines):
        pattern = PAIR if number % (rows + 1) == 0 else row
        assert pattern.fullmatch(line.lstrip(" ")), line


@pytest.mark.real
def test_the_real_files_pass_the_same_format_checks(real_data: Path) -> None:
    folder = sorted((real_data / "3dmatch").glob("*-evaluation"))[0]
    check_format((folder / "gt.log").read_text(), POSE_ROW, 4)
    check_format((folder / "gt.info").read_text(), INFO_ROW, 6)


def test_each_listed_pose_is_rigid_and_agrees_with_the_camera_poses(root: Path) -> None:
    for scene in scenes_of(root):
        for (i, j), T_i_j in read_blocks(evaluation_of(scene) / "gt.log", 4).items():
            np.testing.assert_allclose(T_i_j[:3, :3] @ T_i_j[:3, :3].T, np.eye(3), atol=1e-7)
            np.testing.assert_allclose(read_pose(scene, i) @ T_i_j, read_pose(scene, j), atol=1e-6)


def test_a_listed_pose_carries_fragment_j_onto_fragment_i(root: Path) -> None:
    gains = []
    for scene in scenes_of(root):
        pairs = read_blocks(evaluation_of(scene) / "gt.log", 4)
        assert pairs
        for (i, j), T_i_j in pairs.items():
            target, source = read_cloud(scene, i), read_cloud(scene, j)
            after = overlap(target, moved(T_i_j, source))
            assert after >= 0.3
            assert after > overlap(target, moved(np.linalg.inv(T_i_j), source)) + 0.1
            gains.append(after - overlap(target, source))
    assert min(gains) > 0.05
    assert np.median(gains) > 0.25


def test_a_pair_that_is_not_listed_does_not_overlap_enough(root: Path) -> None:
    left_out = 0
    for scene in scenes_of(root):
        listed = read_blocks(evaluation_of(scene) / "gt.log", 4)
        for i in range(FRAGMENTS):
            for j in range(i + 1, FRAGMENTS):
                if (i, j) in listed:
                    continue
                left_out += 1
                T_i_j = np.linalg.inv(read_pose(scene, i)) @ read_pose(scene, j)
                assert overlap(read_cloud(scene, i), moved(T_i_j, read_cloud(scene, j))) < 0.3
    assert left_out > 0


def test_the_information_matrix_says_how_a_small_twist_moves_the_matches(root: Path) -> None:
    twist = np.array([0.01, -0.02, 0.005, 0.003, -0.002, 0.004])
    for scene in scenes_of(root):
        log = read_blocks(evaluation_of(scene) / "gt.log", 4)
        info = read_blocks(evaluation_of(scene) / "gt.info", 6)
        assert info.keys() == log.keys()
        for (i, j), matrix in info.items():
            source = moved(log[i, j], read_cloud(scene, j))
            matches = source[cKDTree(read_cloud(scene, i)).query(source)[0] < 0.05]
            shifts = twist[:3] + np.cross(twist[3:], matches)
            expected = (shifts**2).sum(axis=-1).mean()
            assert 100 < matrix[0, 0] <= 5000
            np.testing.assert_allclose(matrix, matrix.T, atol=1e-4)
            assert twist @ matrix @ twist / matrix[0, 0] == pytest.approx(expected, rel=0.03)


def test_the_same_seed_writes_the_same_bytes_and_another_does_not(tmp_path: Path) -> None:
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        write_threedmatch(
            tmp_path / name, scenes=1, fragments_per_scene=2, frames_per_fragment=1, seed=seed
        )
    first = contents(tmp_path / "first")
    assert first == contents(tmp_path / "again")
    assert first != contents(tmp_path / "other")


def test_a_scene_is_the_same_whatever_number_of_scenes_is_written(
    root: Path, tmp_path: Path
) -> None:
    write_threedmatch(
        tmp_path, scenes=1, fragments_per_scene=FRAGMENTS, frames_per_fragment=FRAMES, seed=7
    )
    alone = contents(tmp_path)
    assert alone.items() <= contents(root).items()


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("scenes", (0, 1, 1)),
        ("fragments_per_scene", (1, 0, 1)),
        ("frames_per_fragment", (1, 1, 0)),
    ],
)
def test_refuses_to_write_nothing(tmp_path: Path, name: str, counts: tuple[int, int, int]) -> None:
    scenes, fragments, frames = counts
    with pytest.raises(ValueError, match=f"needs {name} of at least 1, got 0"):
        write_threedmatch(
            tmp_path,
            scenes=scenes,
            fragments_per_scene=fragments,
            frames_per_fragment=frames,
            seed=0,
        )
