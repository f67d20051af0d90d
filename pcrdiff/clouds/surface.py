"""Meshes and point clouds, and points drawn from their surfaces."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64, Num

FARTHEST_COORDINATE = 1e3
"""No scan, fragment or unit sphere reaches as far; bytes of another type or order do at once."""
NEAREST_COORDINATE = 1e-3
"""None lies wholly nearer to its origin; letters and whole numbers do, read as floats."""


class DegenerateShape(ValueError):
    """A shape of which no pose can be read: all of it is on one line or in one place."""


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh."""

    vertices: Float64[np.ndarray, "v 3"]
    faces: Int64[np.ndarray, "f 3"]


Cloud = Float64[np.ndarray, "points 3"]
Oriented = Float64[np.ndarray, "points 6"]
"""Points, and beside each the normal that the data set gives it; unchecked until it is used."""


def check_cloud(points: Num[np.ndarray, "..."], where: str) -> Cloud | Oriented:
    """Refuse what is no cloud of finite points; else give it in float64.

    Args:
        points: What a file held, normals in columns 3 to 5 if it has them.
        where: The file, for the message.

    Raises:
        ValueError: Neither ``[n, 3]`` nor ``[n, 6]``, no point at all, or a coordinate that is
            NaN or infinite.
    """
    if points.ndim != 2 or points.shape[1] not in (3, 6) or len(points) == 0:
        raise ValueError(
            f"{where} needs points as [n, 3] with n > 0, or [n, 6] with normals, "
            f"got {list(points.shape)}"
        )
    broken = ~np.isfinite(points[:, :3]).all(axis=1)
    if broken.any():
        raise ValueError(
            f"{where} needs finite coordinates, {int(broken.sum())} of its {len(points)} points "
            f"are not, the first is point {int(broken.argmax())}"
        )
    return points.astype(np.float64)


def check_extent(
    cloud: Float64[np.ndarray, "points channels"],
    where: str,
    farthest: float = FARTHEST_COORDINATE,
) -> Cloud | Oriented:
    """Refuse a cloud whose bytes cannot be coordinates in metres or of the unit sphere.

    Args:
        cloud: Points that were stored as bytes, not as text.
        where: The file, for the message.
        farthest: What no coordinate reaches.

    Raises:
        ValueError: A coordinate of ``farthest`` or more, or all of them below
            ``NEAREST_COORDINATE`` though not all are 0.
    """
    largest = float(np.abs(cloud[:, :3]).max())
    if 0 < largest < NEAREST_COORDINATE:
        raise ValueError(
            f"{where} needs coordinates that reach {NEAREST_COORDINATE:g}, got {largest:.3g} at "
            "most: its numbers may be of another type or byte order, or text"
        )
    if largest >= farthest:
        raise ValueError(
            f"{where} needs coordinates below {farthest:g}, got {largest:.3g}: its "
            "numbers may be of another type or byte order"
        )
    return cloud


def sample_points(
    surface: "Mesh | Cloud | Oriented", count: int, *, generator: np.random.Generator
) -> Float64[np.ndarray, "count 3"]:
    """Draw points: uniform by area on a mesh, a random subset without repetition of a cloud.

    Raises:
        ValueError: The cloud holds fewer than ``count`` points, or the mesh is too large for its
            area to be a number.
        DegenerateShape: The mesh has no area.
    """
    if isinstance(surface, Mesh):
        return _sample_mesh(surface, count, generator)[0]
    return np.ascontiguousarray(_sample_cloud(surface, count, generator)[:, :3])


def sample_oriented(
    surface: "Mesh | Cloud | Oriented", count: int, *, generator: np.random.Generator
) -> Float64[np.ndarray, "count 6"]:
    """Draw the same points as ``sample_points``, and beside each the surface's unit normal.

    Of a cloud's normals only the direction is read: files round them, and ModelNet40's put
    ``1,1,1`` where they know none (at 55 of 900,000 points).

    Raises:
        ValueError: As there; or the cloud has no normals, or one that has no direction.
    """
    if isinstance(surface, Mesh):
        points, faces, across, areas = _sample_mesh(surface, count, generator)
        normals = across[faces] / areas[faces, None]
    else:
        points, normals = np.split(_sample_cloud(surface, count, generator), [3], axis=1)
    if normals.shape[1] == 0:
        raise ValueError("sample_oriented needs a cloud with normals, this one has none")
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    good = np.isfinite(lengths) & (lengths > 0)
    if not good.all():
        bad = lengths[~good][0]
        raise ValueError(f"sample_oriented needs normals with a direction, got one of length {bad}")
    return np.hstack([points, normals / lengths])


def _sample_cloud(
    cloud: "Cloud | Oriented", count: int, generator: np.random.Generator
) -> Float64[np.ndarray, "count channels"]:
    """Points with all that the cloud knows of them."""
    if len(cloud) < count:
        raise ValueError(f"sample_points needs {count} points, the cloud has {len(cloud)}")
    return cloud[generator.choice(len(cloud), count, replace=False)]


def _sample_mesh(
    mesh: Mesh, count: int, generator: np.random.Generator
) -> tuple[
    Float64[np.ndarray, "count 3"],
    Int64[np.ndarray, " count"],
    Float64[np.ndarray, "f 3"],
    Float64[np.ndarray, " f"],
]:
    """Points, the face of each, and of all faces the cross product of two sides and its length."""
    columns = np.ascontiguousarray(mesh.vertices.T)
    i, j, k = (np.ascontiguousarray(mesh.faces[:, corner]) for corner in range(3))
    corner = [x[i] for x in columns]
    ab, ac = ([x[end] - x0 for x, x0 in zip(columns, corner, strict=True)] for end in (j, k))
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        across = [ab[y] * ac[z] - ab[z] * ac[y] for y, z in ((1, 2), (2, 0), (0, 1))]
        areas = np.sqrt(across[0] ** 2 + across[1] ** 2 + across[2] ** 2)
    if not np.isfinite(areas.sum()):
        largest = np.abs(mesh.vertices).max()
        raise ValueError(
            f"sample_points needs a mesh whose area is a number, its coordinates reach {largest:g}"
        )
    if not areas.sum() > 0:
        raise DegenerateShape(f"sample_points needs a mesh with area, got {len(areas)} flat faces")
    faces = _choose(areas / areas.sum(), count, generator)
    u, v = generator.random((2, count))
    outside = u + v > 1
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    sides = zip(corner, ab, ac, strict=True)
    points = [x[faces] + u * to_b[faces] + v * to_c[faces] for x, to_b, to_c in sides]
    return np.stack(points, axis=1), faces, np.stack(across, axis=1), areas


def _choose(
    shares: Float64[np.ndarray, " n"], count: int, generator: np.random.Generator
) -> Int64[np.ndarray, " count"]:
    """Draw as ``generator.choice(len(shares), count, p=shares)`` does, to the last bit.

    Sorted numbers are looked up several times faster than ones that jump about.
    """
    cumulative = shares.cumsum()
    cumulative /= cumulative[-1]
    numbers = generator.random(count)
    order = numbers.argsort()
    chosen = np.empty(count, np.int64)
    chosen[order] = cumulative.searchsorted(numbers[order], side="right")
    return chosen
