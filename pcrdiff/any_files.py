"""Points of a file in any of the formats that scans come in."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float64

from pcrdiff.bindings.open3d import open3d
from pcrdiff.clouds.number_rows import read_rows, split_lines, without_comments
from pcrdiff.clouds.off import read_off
from pcrdiff.clouds.ply import read_ply
from pcrdiff.clouds.surface import Cloud, Mesh, check_cloud, sample_points

MESH_POINTS = 20_000
"""Drawn from a mesh's surface, by area: its vertices lie where its triangles are small."""
BIN_CHANNELS = 4
"""Of KITTI's scans: x, y, z and reflectance as little-endian float32."""
SEPARATORS = (",", ";", None)
"""Between the columns of a text, the first that its first line has; else blanks."""


def read_any(path: Path) -> Cloud:
    """Read the points of a file, in its own frame and unit; the ending says the format.

    PLY, PCD, NPY, NPZ, KITTI's BIN, and text of ``x y z`` and further columns (XYZ, TXT, CSV, whose
    first line may be names). Of meshes (OFF, OBJ, STL) points are drawn from the surface, the same
    ones each time.

    Raises:
        FileNotFoundError: No such file.
        ValueError: Another ending, or the file is not what its ending says, or holds no points or
            some that are not finite.
    """
    if not path.is_file():
        raise FileNotFoundError(f"a cloud is needed at {path}, there is no such file")
    ending = path.suffix.lower()
    if ending not in READERS:
        known = ", ".join(READERS)
        raise ValueError(f"{path} needs an ending among {known}, got {ending or 'none'!r}")
    return check_cloud(READERS[ending](path), str(path))[:, :3]


def as_points(cloud: Any, who: str) -> Cloud:  # noqa: ANN401
    """The points of an array, a tensor or a file, in float64.

    Raises:
        FileNotFoundError, ValueError: It is no cloud; ``who`` names it unless it is a file.
    """
    if isinstance(cloud, str | os.PathLike):
        return read_any(Path(cloud))
    array = np.asarray(cloud.detach().cpu() if hasattr(cloud, "detach") else cloud)
    return check_cloud(_coordinates(array, f"the {who} cloud"), f"the {who} cloud")


def _coordinates(array: np.ndarray, where: str) -> Float64[np.ndarray, "n 3"]:
    """The first three columns of an array of numbers, in float64; ``where`` is for the message."""
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        shown = f"{array.dtype} {list(array.shape)}"
        raise ValueError(f"{where} needs numbers as [n, 3] or wider, got {shown}")
    return np.asarray(array[:, :3], np.float64)


def _read_mesh(path: Path) -> Float64[np.ndarray, "n 3"]:
    mesh = open3d.io.read_triangle_mesh(path)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.triangles, np.int64)
    if len(faces) == 0:
        return vertices
    return _draw(Mesh(check_cloud(vertices, str(path)), faces))


def _draw(mesh: Mesh) -> Float64[np.ndarray, "n 3"]:
    return sample_points(mesh, MESH_POINTS, generator=np.random.default_rng(0))


def _read_pcd(path: Path) -> Float64[np.ndarray, "n 3"]:
    """Without the points of an organised cloud that saw nothing, which are NaN."""
    announced = _announced(path)
    points = np.asarray(open3d.io.read_point_cloud(path, remove_nan_points=False).points)
    if len(points) != announced:
        raise ValueError(f"{path} needs the {announced} points it announces, got {len(points)}")
    saw: Float64[np.ndarray, "n 3"] = points[~np.isnan(points).all(axis=1)]
    return saw


def _announced(path: Path) -> int:
    """The number of points in a PCD header, if the file is as long as that."""
    content = path.read_bytes()
    head, found, data = content.partition(b"\nDATA ")
    fields = dict(line.decode("ascii", "replace").partition(" ")[::2] for line in head.splitlines())
    if not found or not fields.get("POINTS", "").strip().isdigit():
        raise ValueError(f"{path} needs to be a PCD file with the lines `POINTS` and `DATA`")
    count, (kind, _, body) = int(fields["POINTS"]), data.partition(b"\n")
    try:
        widths = [int(width) for width in fields["SIZE"].split()]
        times = [int(each) for each in fields.get("COUNT", "1 " * len(widths)).split()]
        size = sum(width * each for width, each in zip(widths, times, strict=True))
    except (KeyError, ValueError) as error:
        raise ValueError(f"{path} needs the line `SIZE` with a number for each field") from error
    if kind.strip() == b"binary" and len(body) < count * size:
        raise ValueError(
            f"{path} needs the {count} points of {size} bytes it announces, it ends after "
            f"{len(body) // size}"
        )
    return count


def _read_array(path: Path) -> Float64[np.ndarray, "n 3"]:
    """An array of rows x, y, z and further columns; an archive holds one such array."""
    try:
        found = np.load(path, allow_pickle=False)
        arrays = dict(found) if path.suffix.lower() == ".npz" else {"": found}
    except (ValueError, OSError, EOFError, BadZipFile) as error:
        raise ValueError(f"{path} needs to be an array that NumPy saved: {error}") from error
    if len(arrays) != 1:
        raise ValueError(f"{path} needs one array, got {', '.join(arrays) or 'none'}")
    (array,) = arrays.values()
    return _coordinates(array, str(path))


def _read_text(path: Path) -> Float64[np.ndarray, "n 3"]:
    lines = split_lines(without_comments(path.read_bytes()), path)
    if not lines:
        return np.zeros((0, 3))
    separator = next(each for each in SEPARATORS if each is None or each in lines[0].text)
    names = [word.strip().lower() for word in lines[0].text.split(separator)]
    if {"x", "y", "z"} <= set(names):
        return read_rows(
            lines[1:], [names.index(axis) for axis in "xyz"], path, "x, y, z", separator
        )
    return read_rows(lines, range(3), path, "rows x, y, z", separator)


def _read_bin(path: Path) -> Float64[np.ndarray, "n 3"]:
    size = 4 * BIN_CHANNELS
    content = path.read_bytes()
    if len(content) % size != 0:
        raise ValueError(f"{path} needs {size} bytes a point, it has {len(content)} bytes in all")
    return np.frombuffer(content, "<f4").reshape(-1, BIN_CHANNELS)[:, :3].astype(np.float64)


READERS: Mapping[str, Callable[[Path], Float64[np.ndarray, "n channels"]]] = {
    ".ply": read_ply,
    ".pcd": _read_pcd,
    ".off": lambda path: _draw(read_off(path)),
    ".obj": _read_mesh,
    ".stl": _read_mesh,
    ".npy": _read_array,
    ".npz": _read_array,
    ".xyz": _read_text,
    ".txt": _read_text,
    ".csv": _read_text,
    ".bin": _read_bin,
}
