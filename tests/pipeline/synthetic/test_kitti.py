"""The synthetic KITTI has the official layout; its scans, calibration and poses agree."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipeline.synthetic.kitti import write_kitti

SEQUENCES, SCANS = 2, 8
BEAMS_DEG = np.array([2 - n / 3 for n in range(32)] + [-8.83 - n / 2 for n in range(32)])


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitti")
    write_kitti(root, sequences=SEQUENCES, scans_per_sequence=SCANS, seed=5)
    return root


def read_scan(root: Path, sequence: int, scan: int) -> np.ndarray:
    path = root / "sequences" / f"{sequence:02d}" / "velodyne" / f"{scan:06d}.bin"
    return np.fromfile(path, np.float32).reshape(-1, 4)


def read_calibration(root: Path, sequence: int) -> dict[str, np.ndarray]:
    lines = (root / "sequences" / f"{sequence:02d}" / "calib.txt").read_text().splitlines()
    fields = dict(line.split(": ") for line in lines)
    return {name: np.array(text.split(), float).reshape(3, 4) for name, text in fields.items()}


def squared(rows: np.ndarray) -> np.ndarray:
    return np.vstack([rows, [0.0, 0.0, 0.0, 1.0]])


def read_poses(root: Path, sequence: int) -> list[np.ndarray]:
    return [squared(row.reshape(3, 4)) for row in np.loadtxt(root / f"poses/{sequence:02d}.txt")]


def moved(T: np.ndarray, points: np.ndarray) -> np.ndarray:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def distance_above_ground(target: np.ndarray, source: np.ndarray) -> float:
    """Median distance of the source's points above the ground to the nearest one of the target."""
    raised = source[(source[:, 2] > -1.2) & (np.linalg.norm(source, axis=1) < 30)][::9]
    return float(np.median(cKDTree(target).query(raised)[0]))


def contents(root: Path) -> dict[str, bytes]:
    return {str(p.relative_to(root)): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def test_the_folders_and_files_are_named_as_the_official_ones(root: Path) -> None:
    expected = {f"poses/{n:02d}.txt" for n in range(SEQUENCES)}
    for n in range(SEQUENCES):
        expected |= {f"sequences/{n:02d}/{name}" for name in ("calib.txt", "times.txt")}
        expected |= {f"sequences/{n:02d}/velodyne/{k:06d}.bin" for k in range(SCANS)}
    assert set(contents(root)) == expected


def test_a_scan_is_finite_points_with_reflectance(root: Path) -> None:
    for scan in range(SCANS):
        points = read_scan(root, 0, scan)
        ranges = np.linalg.norm(points[:, :3], axis=1)
        assert np.isfinite(points).all()
        assert 20_000 < len(points) < 64_000
        assert 1.0 < ranges.min() < 5.0
        assert 50.0 < ranges.max() <= 120.0
        assert points[:, 3].min() >= 0.0
        assert points[:, 3].max() <= 0.99
        assert len(np.unique(points[:, 3])) > 30


def test_every_point_lies_on_a_beam_of_the_sensor(root: Path) -> None:
    x, y, z, _ = read_scan(root, 1, 2).astype(np.float64).T
    elevation = np.degrees(np.arctan2(z, np.hypot(x, y)))
    off = np.abs(elevation[:, None] - BEAMS_DEG)
    assert off.min(axis=1).max() < 1e-3
    assert len(np.unique(off.argmin(axis=1))) > 60


def test_pulses_are_lost_even_where_everything_around_answers(root: Path) -> None:
    x, y, z, _ = read_scan(root, 0, 0).astype(np.float64).T
    lowest = np.degrees(np.arctan2(z, np.hypot(x, y))) < -24.0  # road all round
    columns = np.rint(np.degrees(np.arctan2(y[lowest], x[lowest])) / 0.36)
    assert 0.005 < 1 - len(np.unique(columns)) / 1000 < 0.2


def test_the_road_is_where_the_sensor_height_says_and_its_ranges_are_noisy(root: Path) -> None:
    points = read_scan(root, 0, 0).astype(np.float64)
    near = points[np.hypot(points[:, 0], points[:, 1]) < 5.0, :3]
    road = near[(np.abs(near[:, 1]) < 1.7) & (near[:, 2] < -1.4)]
    assert np.median(road[:, 2]) == pytest.approx(-1.73, abs=0.08)
    plane = np.column_stack([road[:, :2], np.ones(len(road))])
    residuals = road[:, 2] - plane @ np.linalg.lstsq(plane, road[:, 2], rcond=None)[0]
    assert 0.003 < residuals.std() < 0.03


def test_the_calibration_turns_lidar_axes_into_camera_axes(root: Path) -> None:
    calibration = read_calibration(root, 0)
    assert list(calibration) == ["P0", "P1", "P2", "P3", "Tr"]
    R, t = calibration["Tr"][:, :3], calibration["Tr"][:, 3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(R) == pytest.approx(1.0)
    axes = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    angle = np.degrees(np.arccos((np.trace(R @ axes.T) - 1) / 2))
    assert 0.1 < angle < 3.0
    assert 0.1 < np.linalg.norm(t) < 0.5


def test_the_poses_start_at_identity_and_span_more_than_ten_metres(root: Path) -> None:
    for sequence in range(SEQUENCES):
        poses = read_poses(root, sequence)
        assert len(poses) == SCANS
        np.testing.assert_array_equal(poses[0], np.eye(4))
        for T in poses:
            np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-5)
        centres = np.array([T[:3, 3] for T in poses])
        steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        assert steps.min() > 1.0
        assert steps.max() < 2.1
        assert np.linalg.norm(centres[-1] - centres[0]) > 10.0
        assert np.argmax(np.abs(centres[-1])) == 2  # a camera drives along its z axis


def test_the_times_grow_by_a_tenth_of_a_second(root: Path) -> None:
    times = np.loadtxt(root / "sequences" / "00" / "times.txt")
    np.testing.assert_allclose(times, np.arange(SCANS) * 0.1)


@pytest.mark.parametrize("sequence", range(SEQUENCES))
@pytest.mark.parametrize("later", [1, 7])
def test_scans_align_through_tr_and_poses_and_only_so(
    root: Path, sequence: int, later: int
) -> None:
    Tr = squared(read_calibration(root, sequence)["Tr"])
    T_camera = read_poses(root, sequence)[later]
    target = read_scan(root, sequence, 0)[:, :3].astype(np.float64)
    source = read_scan(root, sequence, later)[:, :3].astype(np.float64)
    T_target_source = np.linalg.inv(Tr) @ T_camera @ Tr
    aligned = distance_above_ground(target, moved(T_target_source, source))
    assert aligned < 0.15
    assert distance_above_ground(target, source) > 2.5 * aligned
    assert distance_above_ground(target, moved(T_camera, source)) > 2.5 * aligned


def test_two_sequences_are_two_streets(root: Path) -> None:
    first, second = (read_scan(root, n, 0)[:, :3].astype(np.float64) for n in range(2))
    same = read_scan(root, 0, 1)[:, :3].astype(np.float64)
    assert distance_above_ground(first, second) > 1.5 * distance_above_ground(first, same)


def test_the_same_seed_writes_the_same_bytes_and_another_does_not(tmp_path: Path) -> None:
    for name, seed in (("first", 1), ("again", 1), ("other", 2)):
        write_kitti(tmp_path / name, sequences=1, scans_per_sequence=2, seed=seed)
    first = contents(tmp_path / "first")
    assert first == contents(tmp_path / "again")
    assert first != contents(tmp_path / "other")


def test_a_sequence_is_the_same_whatever_number_of_sequences_is_written(
    root: Path, tmp_path: Path
) -> None:
    write_kitti(tmp_path, sequences=1, scans_per_sequence=SCANS, seed=5)
    assert contents(tmp_path).items() <= contents(root).items()


@pytest.mark.parametrize(
    ("name", "sequences", "scans"), [("sequences", 0, 1), ("scans_per_sequence", 1, 0)]
)
def test_refuses_to_write_nothing(tmp_path: Path, name: str, sequences: int, scans: int) -> None:
    with pytest.raises(ValueError, match=f"needs {name} of at least 1, got 0"):
        write_kitti(tmp_path, sequences=sequences, scans_per_sequence=scans, seed=0)


@pytest.mark.real
def test_the_real_calibration_and_poses_read_by_the_same_code(real_data: Path) -> None:
    kitti = real_data / "kitti"
    assert list(read_calibration(kitti, 0)) == ["P0", "P1", "P2", "P3", "Tr"]
    Tr, poses = squared(read_calibration(kitti, 0)["Tr"]), read_poses(kitti, 0)
    target, source = (read_scan(kitti, 0, n)[:, :3].astype(np.float64) for n in (0, 1))
    T_target_source = np.linalg.inv(Tr) @ poses[1] @ Tr
    assert distance_above_ground(target, moved(T_target_source, source)) < 0.25
