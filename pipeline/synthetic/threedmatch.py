"""A synthetic 3DMatch: furnished rooms seen by a depth camera, in the official layout."""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.spatial import cKDTree

from pcrdiff.loops import Progress, silent
from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.scenes.room import KINDS, sample_camera_path, sample_room

Points = Float64[np.ndarray, "points 3"]
Pose = Float64[np.ndarray, "4 4"]

WIDTH, HEIGHT, FOCAL = 160, 120, 160.0  # pixels: 53 degrees across
NEAREST, FARTHEST = 0.4, 3.0  # metres
READINGS = 8  # depth images averaged where the camera stands still: fusion does so for free
DISPARITY_STEPS = 8 * 580.0 * 0.075  # eighths of a pixel; focal length in pixels, baseline in m
VOXEL = 0.025  # metres
TURN_PER_FRAGMENT = 0.42  # radians the camera walks round the room while it fills a fragment
OVERLAP_RADIUS, LEAST_OVERLAP = 0.05, 0.30  # the official protocol: metres, share of the points
MOST_MATCHES = 5000  # of a pair, in gt.info


def write_threedmatch(
    root: Path,
    *,
    scenes: int,
    fragments_per_scene: int,
    frames_per_fragment: int,
    seed: int,
    progress: Progress = silent,
) -> None:
    """Write ``scenes`` rooms as ``<scene>/cloud_bin_N.ply`` and ``<scene>-evaluation/gt.*``.

    Each fragment fuses ``frames_per_fragment`` depth images into the frame of its first camera
    (metres; x right, y down, z forward). ``gt.log`` lists every pair i < j that overlaps by at
    least 30 %: the smaller of the two shares of points with a neighbour within 5 cm.
    Scene n depends on ``(seed, n)`` alone, so fewer scenes are the first of more.

    Raises:
        ValueError: A count is not positive.
    """
    counts = {
        "scenes": scenes,
        "fragments_per_scene": fragments_per_scene,
        "frames_per_fragment": frames_per_fragment,
    }
    for name, count in counts.items():
        if count < 1:
            raise ValueError(f"write_threedmatch needs {name} of at least 1, got {count}")
    for scene in progress(range(scenes), "3DMatch scenes"):
        _write_scene(root, scene, fragments_per_scene, frames_per_fragment, seed)


def _write_scene(root: Path, scene: int, fragments: int, frames: int, seed: int) -> None:
    kind = KINDS[scene % len(KINDS)]
    name = f"synthetic-{kind}_{scene // len(KINDS)}"
    layout = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(scene,)))
    room = sample_room(kind, generator=layout)
    path = sample_camera_path(
        room, fragments * frames, TURN_PER_FRAGMENT / frames, generator=layout
    ).reshape(fragments, frames, 4, 4)
    rays = RayScene([room.mesh])
    folder = root / name
    folder.mkdir(parents=True, exist_ok=True)
    clouds = []
    for index, T_room_cameras in enumerate(path):
        noise = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(scene, index)))
        cloud = _scan_fragment(rays, T_room_cameras, noise)
        _write_ply(folder / f"cloud_bin_{index}.ply", cloud)
        first = index * frames
        header = (name, "seq-01", first, first + frames - 1)
        (folder / f"cloud_bin_{index}.info.txt").write_text(_block(header, T_room_cameras[0]))
        clouds.append(cloud.astype(np.float64))
    _write_pairs(root / f"{name}-evaluation", clouds, path[:, 0])


def _scan_fragment(
    rays: RayScene,
    T_room_cameras: Float64[np.ndarray, "frames 4 4"],
    generator: np.random.Generator,
) -> Float32[np.ndarray, "points 3"]:
    """Fuse several depth images into the frame of the first camera."""
    T_first_room = np.linalg.inv(T_room_cameras[0])
    frames = [_moved(T_first_room @ T, _depth_image(rays, T, generator)) for T in T_room_cameras]
    return _averaged_by_voxel(np.concatenate(frames)).astype(np.float32)


def _moved(T: Pose, points: Points) -> Points:
    moved: Points = points @ T[:3, :3].T + T[:3, 3]
    return moved


def _depth_image(rays: RayScene, T_room_camera: Pose, generator: np.random.Generator) -> Points:
    """What a structured-light camera sees, in its own frame.

    Noise after Nguyen et al. 2012 (Kinect), then steps of an eighth of a pixel of disparity;
    grazing surfaces and a few pixels at random stay empty.
    """
    v, u = np.meshgrid(np.arange(HEIGHT), np.arange(WIDTH), indexing="ij")
    x, y = (u.reshape(-1) - (WIDTH - 1) / 2) / FOCAL, (v.reshape(-1) - (HEIGHT - 1) / 2) / FOCAL
    pixels = np.column_stack([x, y, np.ones_like(x)])  # z = 1: distances are depths
    hits = rays.cast(T_room_camera[:3, 3], pixels @ T_room_camera[:3, :3].T)
    seen = np.isfinite(hits.distance) & (hits.cosine > 0.15) & (hits.distance < FARTHEST + 1)
    seen &= generator.random(len(pixels)) > 0.02
    depth = hits.distance[seen]
    deviation = 0.0012 + 0.0019 * (depth - 0.4) ** 2
    readings = depth + deviation * generator.standard_normal((READINGS, len(depth)))
    depth = (DISPARITY_STEPS / np.maximum(np.rint(DISPARITY_STEPS / readings), 1.0)).mean(axis=0)
    near = (depth >= NEAREST) & (depth <= FARTHEST)
    points: Points = pixels[seen][near] * depth[near, None]
    return points


def _averaged_by_voxel(points: Points) -> Float64[np.ndarray, "voxels 3"]:
    """One point a voxel, the mean of those in it, ordered by voxel."""
    cells = np.floor(points / VOXEL).astype(np.int64)
    cells -= cells.min(axis=0)
    numbers = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    _, owner, sizes = np.unique(numbers, return_inverse=True, return_counts=True)
    sums = [np.bincount(owner, points[:, axis]) for axis in range(3)]
    averages: Float64[np.ndarray, "voxels 3"] = np.column_stack(sums) / sizes[:, None]
    return averages


def _write_pairs(
    folder: Path,
    clouds: list[Float64[np.ndarray, "_ 3"]],
    T_room_fragments: Float64[np.ndarray, "fragments 4 4"],
) -> None:
    """List the pairs that overlap enough in ``gt.log``, their information in ``gt.info``."""
    log, info = [], []
    trees = [cKDTree(cloud) for cloud in clouds]
    for i, target in enumerate(clouds):
        for j in range(i + 1, len(clouds)):
            T_i_j = np.linalg.inv(T_room_fragments[i]) @ T_room_fragments[j]
            source = _moved(T_i_j, clouds[j])
            near = _has_neighbour(trees[i], source)
            back = _has_neighbour(trees[j], _moved(np.linalg.inv(T_i_j), target))
            if min(near.mean(), back.mean()) >= LEAST_OVERLAP:
                log.append(_block((i, j, len(clouds)), T_i_j))
                info.append(_block((i, j, len(clouds)), _information(source[near])))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "gt.log").write_text("".join(log))
    (folder / "gt.info").write_text("".join(info))


def _has_neighbour(tree: cKDTree, points: Points) -> Bool[np.ndarray, " points"]:
    distance, _ = tree.query(points, distance_upper_bound=OVERLAP_RADIUS)
    return np.asarray(np.isfinite(distance))


def _information(matches: Points) -> Float64[np.ndarray, "6 6"]:
    """Sum of J^T J over matched points p, J = [I | -[p]x]: how a small twist moves them.

    Order: translation, rotation; in the frame of fragment i, as in the official files.
    """
    p = matches[:: -(-len(matches) // MOST_MATCHES)]
    turns = np.cross(np.eye(3), p[:, None]).transpose(0, 2, 1)  # column k is e_k x p
    J = np.concatenate([np.broadcast_to(np.eye(3), turns.shape), turns], axis=2).reshape(-1, 6)
    information: Float64[np.ndarray, "6 6"] = J.T @ J
    return information


def _block(header: tuple[str | int, ...], matrix: Float64[np.ndarray, "rows columns"]) -> str:
    """A header line and a matrix, with the spaces and tabs of the official files."""
    lines = [[str(entry) for entry in header]]
    lines += [[f"{value:15.8e}" for value in row] for row in matrix + 0.0]  # + 0.0: no "-0"
    return "".join(" ".join(f"{field}\t" for field in line) + "\n" for line in lines)


def _write_ply(path: Path, points: Float32[np.ndarray, "points 3"]) -> None:
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    path.write_bytes(header.encode("ascii") + points.astype("<f4").tobytes())
