"""A synthetic KITTI odometry set: streets scanned by a 64-beam lidar, in the official layout."""

from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64

from pcrdiff.loops import Progress, silent
from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.scenes.street import Material, Road, sample_street
from pipeline.synthetic.shapes.solids import join

Pose = Float64[np.ndarray, "4 4"]

# HDL-64E: an upper block of beams every third of a degree, a lower one every half.
ELEVATIONS_DEG = np.concatenate([2.0 - np.arange(32) / 3, -8.83 - np.arange(32) / 2])
COLUMNS = 1000  # directions in a turn; the real sensor has about 2,000
SENSOR_HEIGHT = 1.73  # metres above the road
REACH = 120.0  # metres at which a perfect mirror still answers
RANGE_NOISE = 0.02  # metres, standard deviation
SECONDS_PER_SCAN = 0.1
STREET_BEYOND = 90.0  # metres of street before the first and after the last scan

# Camera from lidar: axes swapped (x right, y down, z forward), turned by a fraction of a degree.
TR = np.array(
    [
        [0.000612372, -0.999938, -0.011121, -0.0127],
        [-0.008165, 0.011116, -0.999905, -0.0681],
        [0.999966, 0.000703, -0.008157, -0.2835],
    ]
)
FOCAL, CENTRE, BASELINES = 712.5, (608.25, 184.5), (0.0, -0.537, 0.06, -0.473)


def write_kitti(
    root: Path,
    *,
    sequences: int,
    scans_per_sequence: int,
    seed: int,
    progress: Progress = silent,
) -> None:
    """Write ``sequences/NN/{velodyne/NNNNNN.bin,calib.txt,times.txt}`` and ``poses/NN.txt``.

    Scans are float32 rows x, y, z (metres; forward, left, up) and reflectance. A line of
    ``poses/NN.txt`` is the left camera's 3x4 pose in the frame of the first one, so the way to a
    scan leads through ``Tr``. The car moves 1.5 to 2 m between scans: eight scans span more than
    10 m. Sequence n depends on ``(seed, n)`` alone.

    Raises:
        ValueError: A count is not positive.
    """
    counts = {"sequences": sequences, "scans_per_sequence": scans_per_sequence}
    for name, count in counts.items():
        if count < 1:
            raise ValueError(f"write_kitti needs {name} of at least 1, got {count}")
    for sequence in progress(range(sequences), "KITTI sequences"):
        _write_sequence(root, sequence, scans_per_sequence, seed)


def _write_sequence(root: Path, sequence: int, scans: int, seed: int) -> None:
    layout = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(sequence,)))
    road, parts = sample_street(2 * STREET_BEYOND + 2.0 * scans, generator=layout)
    drive = _sample_drive(road, scans, generator=layout)
    meshes = [[mesh for made_of, mesh in parts if made_of is m] for m in Material]
    rays = RayScene([join(*of_one) for of_one in meshes])
    folder = root / "sequences" / f"{sequence:02d}"
    (folder / "velodyne").mkdir(parents=True, exist_ok=True)
    (root / "poses").mkdir(exist_ok=True)
    for index, T_world_lidar in enumerate(drive):
        noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(sequence, index)))
        scan = _scan(rays, T_world_lidar, generator=noise)
        (folder / "velodyne" / f"{index:06d}.bin").write_bytes(scan.astype("<f4").tobytes())
    times = [f"{index * SECONDS_PER_SCAN:.6e}\n" for index in range(scans)]
    (folder / "times.txt").write_text("".join(times))
    (folder / "calib.txt").write_text(_calibration())
    (root / "poses" / f"{sequence:02d}.txt").write_text(_camera_poses(drive))


def _sample_drive(
    road: Road, scans: int, *, generator: np.random.Generator
) -> Float64[np.ndarray, "scans 4 4"]:
    """T_world_lidar of every scan: on the right-hand lane, weaving, rolling and pitching a bit."""
    steps = generator.uniform(1.55, 1.9) + generator.uniform(-0.05, 0.05, scans)
    s = STREET_BEYOND + np.cumsum(steps) - steps[0]
    left = -1.5 + 0.3 * np.sin(s / 9 + generator.uniform(0, 2 * np.pi))
    sway = 0.006 * generator.standard_normal((scans, 2))
    return np.stack([_lidar_pose(road, *state) for state in zip(s, left, *sway.T, strict=True)])


def _lidar_pose(road: Road, s: float, left: float, roll: float, pitch: float) -> Pose:
    x, y, z, heading = road.at(s, left)
    rise = (road.at(s + 1.5)[2] - road.at(s - 1.5)[2]) / 3
    forward = np.array([np.cos(heading), np.sin(heading), rise + pitch])
    forward /= np.linalg.norm(forward)
    level = np.array([-np.sin(heading), np.cos(heading), roll])
    up = np.cross(forward, level)
    up /= np.linalg.norm(up)
    T_world_lidar = np.eye(4)
    T_world_lidar[:3, :3] = np.column_stack([forward, np.cross(up, forward), up])
    T_world_lidar[:3, 3] = np.array([x, y, z + 0.04]) + SENSOR_HEIGHT * up
    return T_world_lidar


def _beams() -> Float64[np.ndarray, "rays 3"]:
    """Unit directions, beam by beam from the top, each turning counter-clockwise from ahead."""
    elevation, azimuth = np.meshgrid(
        np.radians(ELEVATIONS_DEG), np.arange(COLUMNS) * 2 * np.pi / COLUMNS, indexing="ij"
    )
    flat = np.cos(elevation)
    directions = np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1
    )
    return directions.reshape(-1, 3)


def _scan(
    rays: RayScene, T_world_lidar: Pose, *, generator: np.random.Generator
) -> Float32[np.ndarray, "points 4"]:
    """One turn of the lidar, in its own frame.

    The answer fades with distance and with grazing angle; weak ones are lost, as are those from
    glass and, at random, a few of any material.
    """
    beams = _beams()
    hits = rays.cast(T_world_lidar[:3, 3], beams @ T_world_lidar[:3, :3].T)
    returned, lost = np.array([material.value for material in Material])[hits.part].T
    reflectance = returned * hits.cosine**0.5
    distance = hits.distance + RANGE_NOISE * generator.standard_normal(len(beams))
    strong = distance < REACH * np.clip(2.2 * reflectance, 0.2, 1.0) ** 0.5
    kept = (hits.part >= 0) & strong & (distance > 1.0) & (generator.random(len(beams)) > lost)
    shine = np.clip(reflectance + 0.04 * generator.standard_normal(len(beams)), 0.0, 0.99)
    points = beams[kept] * distance[kept, None]
    return np.column_stack([points, np.round(shine[kept], 2)]).astype(np.float32)


def _calibration() -> str:
    """``P0`` to ``P3`` of rectified cameras side by side, and ``Tr`` from lidar to camera 0."""
    lines = []
    for camera, baseline in enumerate(BASELINES):
        P = np.zeros((3, 4))
        P[0, 0], P[1, 1], P[2, 2] = FOCAL, FOCAL, 1.0
        P[:2, 2], P[0, 3] = CENTRE, FOCAL * baseline
        lines.append(_line(f"P{camera}: ", P, 12))
    return "".join([*lines, _line("Tr: ", _lidar_to_camera()[:3], 12)])


def _lidar_to_camera() -> Pose:
    """``TR`` as a 4x4, its rotation made exact."""
    U, _, Vh = np.linalg.svd(TR[:, :3])
    T_camera_lidar = np.eye(4)
    T_camera_lidar[:3, :3], T_camera_lidar[:3, 3] = U @ Vh, TR[:, 3]
    return T_camera_lidar


def _camera_poses(T_world_lidars: Float64[np.ndarray, "scans 4 4"]) -> str:
    T_lidar_camera = np.linalg.inv(_lidar_to_camera())
    T_world_cameras = T_world_lidars @ T_lidar_camera
    T_first_cameras = np.linalg.inv(T_world_cameras[0]) @ T_world_cameras
    T_first_cameras[0] = np.eye(4)  # to the last digit
    return "".join(_line("", T[:3], 6) for T in T_first_cameras)


def _line(label: str, matrix: Float64[np.ndarray, "3 4"], digits: int) -> str:
    return label + " ".join(f"{value:.{digits}e}" for value in matrix.reshape(-1) + 0.0) + "\n"
