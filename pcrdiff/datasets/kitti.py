"""KITTI odometry: lidar scans of a driving car, and the car's poses."""

from collections.abc import Sequence
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float64

from pcrdiff.clouds.number_rows import Line, read_lines, read_number
from pcrdiff.clouds.surface import (
    FARTHEST_COORDINATE,
    NEAREST_COORDINATE,
    Cloud,
    check_cloud,
    check_extent,
)
from pcrdiff.datasets.items import RawItem, RecordedPair, check_rigid
from pcrdiff.datasets.listing import check_names, list_files, list_folders, refuse_several

BYTES_PER_POINT = 16
"""x, y, z and reflectance as little-endian float32."""
OTHER_LAYOUTS = {
    "float64 x, y, z, reflectance": ("<f8", 4),
    "big-endian float32 x, y, z, reflectance": (">f4", 4),
    "float32 x, y, z, intensity, ring": ("<f4", 5),
    "float32 x, y, z, 1, intensity and three zeros": ("<f4", 8),
    "float64 x, y, z": ("<f8", 3),
    "float32 x, y, z": ("<f4", 3),
}
"""What else scans are saved as: type and numbers per point, the likelier reading first."""
REFLECTANCE_TOLERANCE = 0.01
"""How far a re-encoded reflectance may lie outside 0..1."""
LEAST_DISTINCT = 0.75
"""The share of a scan's points that lie at places of their own; all of a recorded one do."""
SEQUENCES_WITH_POSES = 11
"""The official data set publishes the poses of sequences 00 to 10; 11 to 21 have none."""
FARTHEST = 2.0
"""A pair lies at most this many times ``min_distance`` apart: scans may be missing between."""


def read_items(root: Path) -> list[RawItem]:
    """List the scans ``sequences/NN/velodyne/NNNNNN.bin`` in the order of their numbers.

    Args:
        root: The folder that holds ``sequences/``, or the one whose ``dataset/`` does.

    Returns:
        One item per scan: x, y, z in metres in the lidar's frame (x ahead, z up), without the
        reflectance; ``name`` is ``NN/NNNNNN``, ``group`` the sequence; there is no split.

    Raises:
        FileNotFoundError: No such folder, or no scan in it.
        ValueError: There are ``sequences/`` in both places, or a sequence or a scan has another
            name.
        OSError: A folder cannot be listed.
    """
    folder = _find_dataset(root)
    sequences = list_folders(folder / "sequences")
    check_names(sequences, "[0-9]{2}", "00")
    paths = [path for sequence in sequences for path in _list_scans(sequence)]
    if not paths:
        raise FileNotFoundError(
            f"KITTI needs sequences/00/velodyne/000000.bin, {folder} holds no scan"
        )
    scans = [(path.parent.parent.name, path) for path in paths]
    return [
        RawItem(f"{sequence}/{path.stem}", sequence, None, partial(read_scan, path), path)
        for sequence, path in scans
    ]


def _find_dataset(root: Path) -> Path:
    found = [folder for folder in (root, root / "dataset") if (folder / "sequences").is_dir()]
    if not found:
        raise FileNotFoundError(
            f"KITTI needs a folder `sequences` or `dataset/sequences` in {root}"
        )
    refuse_several([(folder / "sequences", "scans") for folder in found], root)
    return found[0]


def _list_scans(sequence: Path) -> list[Path]:
    """The scans of a sequence; one without ``velodyne`` has only images or a calibration."""
    found = [folder for folder in list_folders(sequence) if "velodyne" in folder.name.casefold()]
    folder = sequence / "velodyne"
    if folder not in found:
        check_names(found, "velodyne", "velodyne")
        return []
    paths = list_files(folder, ".bin")
    check_names(paths, r"[0-9]{6}\.bin", "000000.bin")
    return paths


def read_scan(path: Path) -> Cloud:
    """Read one lidar scan: x, y, z in metres in the lidar's frame.

    Raises:
        FileNotFoundError: No such file.
        ValueError: A size that is no multiple of 16 bytes, no point, one that is not finite or a
            kilometre away, a reflectance outside 0..1 that is no byte either, or mostly copies of
            the same points; the sentence says which other layout the file looks like.
    """
    if not path.is_file():
        raise FileNotFoundError(f"KITTI needs the scan {path}, which is missing")
    content = path.read_bytes()
    try:
        return _read_points(content, path)
    except ValueError as error:
        raise ValueError(f"{error}{_likely_layout(content)}") from error


def _read_points(content: bytes, path: Path) -> Cloud:
    size = len(content)
    if size % BYTES_PER_POINT != 0:
        raise ValueError(
            f"{path} needs {BYTES_PER_POINT} bytes per point, its {size} bytes are "
            f"{size % BYTES_PER_POINT} more than a whole number of points"
        )
    scan = np.frombuffer(content, "<f4").reshape(-1, 4)
    cloud = check_extent(check_cloud(scan[:, :3], str(path)), str(path))
    if not _is_reflectance(scan[:, 3]):
        raise ValueError(
            f"{path} needs reflectances in 0..1 or bytes of 0..255, "
            f"got {scan[:, 3].min():.3g}..{scan[:, 3].max():.3g}"
        )
    distinct = _count_distinct(cloud)
    if distinct < LEAST_DISTINCT * len(cloud):
        raise ValueError(
            f"{path} needs distinct points, its {len(cloud)} lie at {distinct} places only"
        )
    return cloud


def _is_reflectance(values: Float[np.ndarray, " points"]) -> bool:
    shares = np.abs(values - 0.5) <= 0.5 + REFLECTANCE_TOLERANCE
    whole = (values >= 0) & (values <= 255) & (values == np.round(values))
    return bool(shares.all() or whole.all())


def _count_distinct(cloud: Float64[np.ndarray, "points 3"]) -> int:
    """Count the places, by their projections onto an oblique line: it takes a tenth of the time.

    Without those on the x axis: no lidar sees its own place, and padding reads as such points.
    """
    seen = cloud[(cloud[:, 1] != 0) | (cloud[:, 2] != 0)]
    return len(np.unique(seen @ np.array([1.0, np.pi, np.e])))


def _likely_layout(content: bytes) -> str:
    """The end of a sentence about a scan that cannot be read: what it looks like, if anything."""
    for name, (number, columns) in OTHER_LAYOUTS.items():
        size = np.dtype(number).itemsize * columns
        if content and len(content) % size == 0:
            with np.errstate(invalid="ignore"):  # other bytes may be NaN of any kind
                scan = np.frombuffer(content, number).reshape(-1, columns).astype(np.float64)
            if _is_plausible(scan):
                return f"; it looks like {name}"
    return ""


def _is_plausible(scan: Float64[np.ndarray, "points columns"]) -> bool:
    return bool(
        np.isfinite(scan).all()
        and NEAREST_COORDINATE < np.abs(scan[:, :3]).max() < FARTHEST_COORDINATE
        and (scan.shape[1] == 3 or _is_reflectance(scan[:, 3]))
        and _count_distinct(scan[:, :3]) >= LEAST_DISTINCT * len(scan)
    )


def read_recorded_pairs(root: Path, *, min_distance: float = 10.0) -> list[RecordedPair]:
    """Pair each scan with the next one the car took at least ``min_distance`` away.

    The published poses are of the left camera, so both scans go through ``Tr``, which carries the
    lidar's frame into the camera's: ``T_world_lidar = T_world_camera @ T_camera_lidar``. Where scans
    are missing, and the next one lies more than twice ``min_distance`` away, there is no pair.
    The poses are GPS and inertia, not registration: over the first scans of sequence 00 a pair's
    is off by about a metre, as the scans themselves show; the field refines them by ICP.

    Args:
        root: As for ``read_items``.
        min_distance: Metres between the two places of the lidar.

    Returns:
        Pairs in the order of their sources; ``group`` is the sequence. Pairs of neighbouring
        sources see nearly the same street: keep every tenth for independent ones.

    Raises:
        FileNotFoundError: A sequence from 00 to 10 lacks its ``calib.txt`` or ``poses/NN.txt``, or
            none of the sequences has poses.
        OSError: As for ``read_items``.
        ValueError: As for ``read_items``; ``Tr`` is missing or not rigid, so is a pose, or there are fewer poses than
            scans.
    """
    if not min_distance > 0:
        raise ValueError(f"read_recorded_pairs needs min_distance > 0, got {min_distance}")
    folder = _find_dataset(root)
    sequences = [
        (sequence, [item.name for item in items])
        for sequence, items in groupby(read_items(root), key=lambda item: item.group)
        if int(sequence) < SEQUENCES_WITH_POSES or (folder / f"poses/{sequence}.txt").is_file()
    ]
    if not sequences:
        raise FileNotFoundError(
            f"KITTI needs {folder / 'poses'}/NN.txt to pair scans, none of its sequences has one"
        )
    return [
        pair
        for sequence, names in sequences
        for pair in _pair_scans(names, _read_lidar_poses(folder, sequence, names), min_distance)
    ]


def _pair_scans(
    names: Sequence[str], poses: Float64[np.ndarray, "scans 4 4"], min_distance: float
) -> list[RecordedPair]:
    """Pair scans by the distance of their places; ``poses`` are ``T_world_lidar``."""
    pairs = []
    for source, T_world_source in enumerate(poses):
        distances = np.linalg.norm(poses[source:, :3, 3] - T_world_source[:3, 3], axis=1)
        target = source + int((distances >= min_distance).argmax())
        if min_distance <= distances[target - source] <= FARTHEST * min_distance:
            T_target_source = np.linalg.inv(poses[target]) @ T_world_source
            pose = check_rigid(T_target_source, f"pose of {names[source]}")
            sequence = names[source].partition("/")[0]
            pairs.append(RecordedPair(names[source], names[target], pose, sequence))
    return pairs


def _read_lidar_poses(
    folder: Path, sequence: str, names: Sequence[str]
) -> Float64[np.ndarray, "scans 4 4"]:
    """Read ``T_world_lidar`` of each scan; the world is where the camera was at first."""
    T_camera_lidar = _read_T_camera_lidar(folder / "sequences" / sequence / "calib.txt")
    path = folder / "poses" / f"{sequence}.txt"
    if not path.is_file():
        raise FileNotFoundError(f"KITTI needs the poses {path} to pair scans, which is missing")
    rows = read_lines(path)
    numbers = [int(name.partition("/")[2]) for name in names]
    if max(numbers) >= len(rows):
        raise ValueError(
            f"{path} needs a pose for scan {max(numbers):06d}, it has only {len(rows)} poses"
        )
    return np.stack([_read_pose(rows[number], path) @ T_camera_lidar for number in numbers])


def _read_T_camera_lidar(path: Path) -> Float64[np.ndarray, "4 4"]:
    if not path.is_file():
        raise FileNotFoundError(f"KITTI needs the calibration {path} to pair scans, it is missing")
    for line in read_lines(path):
        key, _, values = line.text.partition(":")
        if key.strip() in ("Tr", "Tr_velo_to_cam"):
            return _read_pose(Line(line.number, values), path)
    raise ValueError(f"{path} needs a line `Tr:` or `Tr_velo_to_cam:`, it has none")


def _read_pose(line: Line, path: Path) -> Float64[np.ndarray, "4 4"]:
    where, words = f"{path}, line {line.number},", line.text.split()
    if len(words) != 12:
        raise ValueError(f"{where} needs 12 numbers, got {len(words)}")
    values = np.array([read_number(word, where, "a pose") for word in words])
    return check_rigid(np.vstack([values.reshape(3, 4), [0, 0, 0, 1]]), where)
