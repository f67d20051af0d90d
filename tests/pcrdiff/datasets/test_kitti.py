"""KITTI's scans and pairs: what is read, what is refused, and that the poses fit."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from pcrdiff.datasets.kitti import read_items, read_recorded_pairs, read_scan
from tests.pcrdiff.clouds.no_numbers import NO_NUMBERS

T_CAMERA_LIDAR = np.array([[0, -1.0, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, -0.3], [0, 0, 0, 1]])


def make_lidar_pose(number: int) -> np.ndarray:
    """T_world_lidar of a car that drives 4 m per scan, turning; the world is the first lidar."""
    T_world_lidar = np.eye(4)
    T_world_lidar[:3, :3] = Rotation.from_euler("z", 3 * number, degrees=True).as_matrix()
    T_world_lidar[:3, 3] = [4 * number, 0.1 * number, 0]
    return T_world_lidar


def format_pose(pose: np.ndarray) -> str:
    return " ".join(f"{value:.6e}" for value in pose[:3].ravel())


def write_sequence(
    root: Path, sequence: str = "00", numbers: tuple[int, ...] = (0, 1, 2, 3, 4)
) -> None:
    folder = root / "sequences" / sequence
    (folder / "velodyne").mkdir(parents=True, exist_ok=True)
    for number in numbers:
        scan = np.random.default_rng(number).random((7, 4), dtype=np.float32)
        (folder / "velodyne" / f"{number:06d}.bin").write_bytes(scan.tobytes())
    (folder / "calib.txt").write_text(
        f"P0: {format_pose(np.eye(4))}\nTr: {format_pose(T_CAMERA_LIDAR)}\n"
    )
    (root / "poses").mkdir(exist_ok=True)
    T_lidar_camera = np.linalg.inv(T_CAMERA_LIDAR)
    cameras = [
        T_CAMERA_LIDAR @ make_lidar_pose(n) @ T_lidar_camera for n in range(max(numbers) + 1)
    ]
    (root / "poses" / f"{sequence}.txt").write_text(
        "".join(f"{format_pose(T_world_camera)}\n" for T_world_camera in cameras)
    )


def test_reads_scans_in_order_without_reflectance(tmp_path: Path) -> None:
    write_sequence(tmp_path, "07", (2, 0))
    write_sequence(tmp_path, "00", (11,))
    items = read_items(tmp_path)
    assert [item.name for item in items] == ["00/000011", "07/000000", "07/000002"]
    assert [item.group for item in items] == ["00", "07", "07"]
    assert {item.split for item in items} == {None}
    cloud = items[0].read()
    assert isinstance(cloud, np.ndarray)
    assert cloud.dtype == np.float64
    np.testing.assert_array_equal(
        cloud, np.random.default_rng(11).random((7, 4), dtype=np.float32)[:, :3]
    )


def test_finds_the_official_folder_dataset(tmp_path: Path) -> None:
    write_sequence(tmp_path / "dataset")
    assert len(read_items(tmp_path)) == len(read_items(tmp_path / "dataset")) == 5
    assert len(read_recorded_pairs(tmp_path)) == 2


def test_items_need_no_calibration_and_no_poses(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    (tmp_path / "poses" / "00.txt").unlink()
    (tmp_path / "sequences" / "00" / "calib.txt").unlink()
    assert len(read_items(tmp_path)) == 5


def test_pairs_each_scan_with_the_next_one_far_enough(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    assert [(pair.source, pair.target) for pair in read_recorded_pairs(tmp_path)] == [
        ("00/000000", "00/000003"),
        ("00/000001", "00/000004"),
    ]
    near = read_recorded_pairs(tmp_path, min_distance=3.0)
    assert [pair.target for pair in near] == [f"00/{number:06d}" for number in (1, 2, 3, 4)]


def test_makes_no_pair_across_a_gap(tmp_path: Path) -> None:
    write_sequence(tmp_path, numbers=(0, 1, 9, 12))
    assert [(pair.source, pair.target) for pair in read_recorded_pairs(tmp_path)] == [
        ("00/000009", "00/000012")
    ]


def test_poses_carry_the_source_lidar_into_the_target_lidar(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    pair = read_recorded_pairs(tmp_path)[1]
    expected = np.linalg.inv(make_lidar_pose(4)) @ make_lidar_pose(1)
    np.testing.assert_allclose(pair.T_target_source, expected, atol=1e-5)
    assert pair.T_target_source[0, 3] < -10  # the car drove ahead: what was here lies behind


def test_reads_the_other_name_of_the_calibration(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    expected = read_recorded_pairs(tmp_path)
    path = tmp_path / "sequences" / "00" / "calib.txt"
    path.write_text(path.read_text().replace("Tr:", "Tr_velo_to_cam:"))
    for pair, same in zip(read_recorded_pairs(tmp_path), expected, strict=True):
        np.testing.assert_array_equal(pair.T_target_source, same.T_target_source)


def test_skips_a_sequence_whose_poses_are_not_published(tmp_path: Path) -> None:
    write_sequence(tmp_path, "00")
    write_sequence(tmp_path, "11")
    (tmp_path / "poses" / "11.txt").unlink()
    assert {pair.group for pair in read_recorded_pairs(tmp_path)} == {"00"}


def test_refuses_a_folder_without_scans(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=f"in {tmp_path}"):
        read_items(tmp_path)
    (tmp_path / "sequences").mkdir()
    with pytest.raises(FileNotFoundError, match="holds no scan"):
        read_items(tmp_path)


def test_refuses_a_truncated_an_empty_and_a_broken_scan(tmp_path: Path) -> None:
    path = tmp_path / "000000.bin"
    path.write_bytes(bytes(16 * 3 + 5))
    with pytest.raises(ValueError, match=r"000000\.bin needs 16 bytes per point.* are 5 more"):
        read_scan(path)
    path.write_bytes(b"")
    with pytest.raises(ValueError, match=r"000000\.bin needs points"):
        read_scan(path)
    path.write_bytes(np.array([[0, np.nan, 0, 1]], dtype=np.float32).tobytes())
    with pytest.raises(ValueError, match=r"000000\.bin needs finite"):
        read_scan(path)
    with pytest.raises(FileNotFoundError, match="gone"):
        read_scan(tmp_path / "gone.bin")


def make_scan(count: int = 48) -> np.ndarray:
    generator = np.random.default_rng(5)
    return generator.uniform([-60, -60, -3, 0], [60, 60, 3, 1], (count, 4)).astype("<f4")


@pytest.mark.parametrize("reflectance", ["bytes", "rounded", "none"])
def test_reads_whatever_way_the_reflectance_was_encoded(tmp_path: Path, reflectance: str) -> None:
    scan, path = make_scan(), tmp_path / "000000.bin"
    scan[:, 3] = {"bytes": scan[:, 3] * 255 // 1, "rounded": -0.004, "none": 0}[reflectance]
    path.write_bytes(scan.tobytes())
    np.testing.assert_array_equal(read_scan(path), scan[:, :3])


def test_refuses_a_scan_in_another_layout_and_says_in_which(tmp_path: Path) -> None:
    scan, path = make_scan(), tmp_path / "000000.bin"
    quarters = (np.abs(scan) * 4).round() / 4  # as float64, every other four bytes are zero
    with_ring = np.hstack([scan[:, :3], scan[:, 3:] * 255 // 1, scan[:, 3:] * 32 // 1])
    for content, name in (
        (scan.astype("<f8"), "float64 x, y, z, reflectance"),
        (scan.round(1).astype("<f8"), "float64 x, y, z, reflectance"),
        (quarters.astype("<f8"), "float64 x, y, z, reflectance"),
        (scan[:, :3].astype("<f8"), "float64 x, y, z"),
        (scan[:, :3], "float32 x, y, z"),
        (scan[:47, :3], "float32 x, y, z"),
        (scan.astype(">f4"), "big-endian float32 x, y, z, reflectance"),
        (with_ring, "float32 x, y, z, intensity, ring"),
    ):
        path.write_bytes(content.tobytes())
        with pytest.raises(ValueError, match=r"000000\.bin needs .*; it looks like") as refused:
            read_scan(path)
        assert str(refused.value).endswith(f"; it looks like {name}")


def test_refuses_a_scan_that_is_implausible_whatever_its_layout(tmp_path: Path) -> None:
    path = tmp_path / "000000.bin"
    for row, column, value, message in (
        (7, 1, -1000.0, r"coordinates below 1000, got 1e\+03"),
        (7, 3, 1.5, r"reflectances in 0\.\.1"),
        (7, 3, -1.0, r"reflectances in 0\.\.1"),
        (slice(20, None), slice(None), 0.0, "its 48 lie at 20 places only"),
        (slice(30, None), slice(1, 3), 0.0, "its 48 lie at 30 places only"),
    ):
        scan = make_scan()
        scan[row, column] = value
        path.write_bytes(scan.tobytes())
        with pytest.raises(ValueError, match=rf"000000\.bin needs .*{message}"):
            read_scan(path)


def test_refuses_points_that_are_padded_to_32_bytes_and_text(tmp_path: Path) -> None:
    scan, path = make_scan(), tmp_path / "000000.bin"
    padded = np.zeros((len(scan), 8), "<f4")
    padded[:, :3], padded[:, 3], padded[:, 4] = scan[:, :3], 1, scan[:, 3]
    path.write_bytes(padded.tobytes())
    with pytest.raises(ValueError, match=r"000000\.bin needs distinct .*three zeros$"):
        read_scan(path)
    text = "\n".join(" ".join(f"{number:.3f}" for number in point) for point in np.abs(scan))
    path.write_bytes(text.encode()[: len(text) // 16 * 16])
    with pytest.raises(ValueError, match=r"000000\.bin needs coordinates that reach 0\.001, got"):
        read_scan(path)


def test_refuses_to_pair_without_calibration_or_poses(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    calib = tmp_path / "sequences" / "00" / "calib.txt"
    calib.write_text(f"P0: {format_pose(np.eye(4))}\n")
    with pytest.raises(ValueError, match=r"calib\.txt needs a line `Tr:`"):
        read_recorded_pairs(tmp_path)
    calib.unlink()
    with pytest.raises(FileNotFoundError, match=r"calib\.txt"):
        read_recorded_pairs(tmp_path)
    write_sequence(tmp_path)
    (tmp_path / "poses" / "00.txt").unlink()
    with pytest.raises(FileNotFoundError, match=r"poses/00\.txt"):
        read_recorded_pairs(tmp_path)


def test_refuses_to_pair_when_no_sequence_has_poses(tmp_path: Path) -> None:
    write_sequence(tmp_path, "11")
    (tmp_path / "poses" / "11.txt").unlink()
    with pytest.raises(FileNotFoundError, match="none of its sequences"):
        read_recorded_pairs(tmp_path)


def test_refuses_too_few_poses_and_broken_ones(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    path = tmp_path / "poses" / "00.txt"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:4]))
    with pytest.raises(ValueError, match=r"00\.txt needs a pose for scan 000004.* only 4 poses"):
        read_recorded_pairs(tmp_path)
    path.write_text("".join([*lines[:4], "1 2 3\n"]))
    with pytest.raises(ValueError, match=r"00\.txt, line 5, needs 12 numbers, got 3"):
        read_recorded_pairs(tmp_path)
    path.write_text("".join([*lines[:4], format_pose(2 * np.eye(4)) + "\n"]))
    with pytest.raises(ValueError, match=r"00\.txt, line 5, needs a rigid pose"):
        read_recorded_pairs(tmp_path)


@pytest.mark.parametrize("word", NO_NUMBERS)
@pytest.mark.parametrize(
    ("name", "line", "where"),
    [
        ("poses/00.txt", 3, r"00\.txt, line 4,"),
        ("sequences/00/calib.txt", 1, r"calib\.txt, line 2,"),
    ],
)
def test_refuses_a_pose_with_what_is_no_finite_number(
    tmp_path: Path, name: str, line: int, where: str, word: str
) -> None:
    write_sequence(tmp_path)
    lines = (tmp_path / name).read_text().splitlines()
    lines[line] = lines[line].rpartition(" ")[0] + f" {word}"
    (tmp_path / name).write_text("\n".join(lines))
    with pytest.raises(ValueError, match=rf"{where} needs a pose of finite numbers") as refused:
        read_recorded_pairs(tmp_path)
    assert repr(word) in str(refused.value)


def test_a_broken_pose_is_named_by_its_line_though_blank_ones_stand_before(tmp_path: Path) -> None:
    write_sequence(tmp_path)
    path = tmp_path / "poses" / "00.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(["", "", *lines[:4], "1 2 3"]))
    with pytest.raises(ValueError, match=r"00\.txt, line 7, needs 12 numbers"):
        read_recorded_pairs(tmp_path)


@pytest.mark.parametrize("name", ["poses/00.txt", "sequences/00/calib.txt"])
def test_names_a_text_that_is_not_in_utf8(tmp_path: Path, name: str) -> None:
    write_sequence(tmp_path)
    path = tmp_path / name
    path.write_bytes(b"# caf\xe9\n" + path.read_bytes())
    where = rf"{path.name}, line 1, .*UTF-8.*0xe9.*Latin-1"
    with pytest.raises(ValueError, match=where):
        read_recorded_pairs(tmp_path)


def test_refuses_a_distance_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="min_distance > 0"):
        read_recorded_pairs(tmp_path, min_distance=0.0)


@pytest.mark.real
def test_refuses_the_real_truncated_scan(real_data: Path) -> None:
    with pytest.raises(ValueError, match=r"truncated_scan\.bin needs 16 bytes per point"):
        read_scan(real_data / "malformed/truncated_scan.bin")


def keep_upright_things(cloud: np.ndarray) -> np.ndarray:
    """Drop the road, which lies on itself wherever the car is, and thin the rest."""
    kept = cloud[(cloud[:, 2] > -1.0) & (np.linalg.norm(cloud[:, :2], axis=1) < 40)]
    thinned: np.ndarray = kept[np.unique(np.floor(kept / 0.3), axis=0, return_index=True)[1]]
    return thinned


@pytest.mark.real
def test_the_recorded_poses_lay_real_scans_onto_each_other(real_data: Path) -> None:
    items, pairs = read_items(real_data / "kitti"), read_recorded_pairs(real_data / "kitti")
    assert (len(items), len(pairs)) == (16, 4)
    clouds = {item.name: keep_upright_things(np.asarray(item.read())) for item in items}
    for pair in pairs:
        target, overlaps = KDTree(clouds[pair.target]), []
        for pose in (pair.T_target_source, np.eye(4), np.linalg.inv(pair.T_target_source)):
            moved = clouds[pair.source] @ pose[:3, :3].T + pose[:3, 3]
            distances, _ = target.query(moved, distance_upper_bound=0.3)
            overlaps.append(np.isfinite(distances).mean())
        right, unmoved, inverted = overlaps
        assert right > 1.5 * unmoved
        assert right > 2.5 * inverted
        assert np.linalg.norm(pair.T_target_source[:3, 3]) >= 10.0
