"""The solids every made-up object is put together from; nearly all are a skin over rings.

Lengths are metres, z is up, the front of an object looks towards -y, angles are degrees.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from pcrdiff.data.raw import Mesh

Real = float | int  # spelt out: beartype knows no numeric tower
Span = tuple[Real, Real]
Vector = tuple[Real, Real, Real]
Outline = Sequence[tuple[Real, Real]] | Float64[np.ndarray, "_ 2"]
Path = Sequence[Vector] | Float64[np.ndarray, "_ 3"]
Axis = Literal["x", "y", "z"]

_AXES: dict[Axis, int] = {"x": 0, "y": 1, "z": 2}
_FLAT = 1e-9  # of the squared extent: a face smaller than this is a seam, not a face


def join(*parts: Mesh) -> Mesh:
    """Put parts into one mesh; what overlaps stays overlapping, as in most CAD models."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
    )


def move(part: Mesh, offset: Vector) -> Mesh:
    """Shift a part."""
    return Mesh(part.vertices + np.array(offset, dtype=np.float64), part.faces)


def turn(part: Mesh, axis: Axis, angle_deg: Real, about: Vector = (0, 0, 0)) -> Mesh:
    """Turn a part about the line through ``about`` along ``axis``, right-handed."""
    first, second = (_AXES[axis] + 1) % 3, (_AXES[axis] + 2) % 3
    cosine, sine = np.cos(np.deg2rad(angle_deg)), np.sin(np.deg2rad(angle_deg))
    R = np.eye(3)
    R[[first, second], [first, second]] = cosine
    R[first, second], R[second, first] = -sine, sine
    centre = np.array(about, dtype=np.float64)
    return Mesh((part.vertices - centre) @ R.T + centre, part.faces)


def stretch(part: Mesh, factors: Vector) -> Mesh:
    """Scale a part along the axes about the origin; a negative factor mirrors it."""
    scale = np.array(factors, dtype=np.float64)
    mirrored = bool(np.prod(scale) < 0)
    return Mesh(part.vertices * scale, part.faces[:, ::-1] if mirrored else part.faces)


def skin(rings: Float64[np.ndarray, "sections sides 3"]) -> Mesh:
    """Stretch a closed surface over rings of points, both ends capped, faces looking outwards."""
    sections, sides = rings.shape[:2]
    index = np.arange(sections * sides).reshape(sections, sides)
    ahead = np.roll(index, -1, axis=1)
    hubs = sections * sides + np.repeat([[0], [1]], sides, axis=1)
    corners = [
        (index[:-1], ahead[:-1], ahead[1:]),
        (index[:-1], ahead[1:], index[1:]),
        (hubs[0], ahead[0], index[0]),
        (hubs[1], index[-1], ahead[-1]),
    ]
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in corners])
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    return _outwards(vertices, faces)


def _outwards(vertices: Float64[np.ndarray, "v 3"], faces: Int64[np.ndarray, "f 3"]) -> Mesh:
    """Drop faces without area and vertices without faces; turn the rest outwards."""
    a, b, c = (vertices[faces[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    normals = np.cross(b - a, c - a)
    if np.einsum("fi,fi->", normals, a) < 0:  # six times the volume
        faces = faces[:, ::-1]
    extent = np.ptp(vertices, axis=0).max()
    kept = faces[np.linalg.norm(normals, axis=1) > _FLAT * extent**2]
    used, renumbered = np.unique(kept, return_inverse=True)
    return Mesh(vertices[used], renumbered.reshape(-1, 3).astype(np.int64))


def block(x: Span, y: Span, z: Span, taper: Real = 1) -> Mesh:
    """A box; its top face is ``taper`` times as wide and as deep as its bottom face."""
    low, high = np.array([x, y, z], dtype=np.float64).T
    across = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (high - low)[:2] / 2
    bottom = np.column_stack([across, np.full(4, low[2])])
    top = np.column_stack([across * taper, np.full(4, high[2])])
    middle = np.array([*(low + high)[:2] / 2, 0])
    return skin(np.stack([bottom, top]) + middle)


def oval(
    centre: Vector, width: Real, depth: Real, squareness: Real = 2, sides: int = 24
) -> Float64[np.ndarray, "sides 3"]:
    """A level ring: an ellipse at squareness 2, nearly a rectangle at 8."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    cosine, sine = np.cos(angle), np.sin(angle)
    x = width / 2 * np.sign(cosine) * np.abs(cosine) ** (2 / squareness)
    y = depth / 2 * np.sign(sine) * np.abs(sine) ** (2 / squareness)
    return np.column_stack([x, y, np.zeros(sides)]) + np.array(centre, dtype=np.float64)


def cushion(x: Span, y: Span, z: Span, squareness: Real = 5, sides: int = 20) -> Mesh:
    """A box with soft edges."""
    centre_x, centre_y = (x[0] + x[1]) / 2, (y[0] + y[1]) / 2
    soft = min(x[1] - x[0], y[1] - y[0], z[1] - z[0]) * 0.3
    levels = [(z[0], soft), (z[0] + soft / 2, 0), (z[1] - soft / 2, 0), (z[1], soft)]
    rings = [
        oval((centre_x, centre_y, h), x[1] - x[0] - inset, y[1] - y[0] - inset, squareness, sides)
        for h, inset in levels
    ]
    return skin(np.stack(rings))


def lathe(profile: Outline, sides: int = 24) -> Mesh:
    """Turn a profile of (radius, z), bottom first, about the z axis."""
    radius, height = np.asarray(profile, dtype=np.float64).T
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    return skin(circle * radius[:, None, None] + np.array([0, 0, 1]) * height[:, None, None])


def hoop(section: Outline, sides: int = 24) -> Mesh:
    """Turn a closed outline of (radius, z), away from the axis, all the way about the z axis."""
    radius, height = np.asarray(section, dtype=np.float64).T
    angle = np.linspace(0, 2 * np.pi, sides + 1)[:, None]
    rings = [radius * np.cos(angle), radius * np.sin(angle), height + 0 * angle]
    return skin(np.stack(rings, axis=-1))


def ball(centre: Vector, radii: Vector, sides: int = 12) -> Mesh:
    """An ellipsoid."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 2)
    profile = np.column_stack([np.cos(angle), np.sin(angle)])
    return move(stretch(lathe(profile, sides), radii), centre)


def tube(path: Path, radius: Real | Sequence[Real], sides: int = 8) -> Mesh:
    """Sweep a circle along a path; ``radius`` is one for all, or one a point of the path."""
    points = np.asarray(path, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(points))
    tangents = np.gradient(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    normal = np.eye(3)[np.abs(tangents[0]).argmin()]
    rings = []
    for point, tangent, r in zip(points, tangents, radii, strict=True):
        normal = normal - (normal @ tangent) * tangent  # carried along, so that nothing twists
        normal = normal / np.linalg.norm(normal)
        spokes = np.outer(np.cos(angle), normal) + np.outer(
            np.sin(angle), np.cross(tangent, normal)
        )
        rings.append(point + r * spokes)
    return skin(np.stack(rings))


def rod(start: Vector, end: Vector, radius: Real, end_radius: Real | None = None) -> Mesh:
    """A straight round bar, thinner or thicker at its end if ``end_radius`` says so."""
    return tube([start, end], [radius, radius if end_radius is None else end_radius], sides=10)


def disc(centre: Vector, axis: Axis, radius: Real, thickness: Real, sides: int = 20) -> Mesh:
    """A flat cylinder about ``axis``."""
    half = np.eye(3)[_AXES[axis]] * thickness / 2
    middle = np.array(centre, dtype=np.float64)
    return tube(np.stack([middle - half, middle + half]), radius, sides=sides)


def slab(outline: Outline, span: Span, axis: Axis = "z") -> Mesh:
    """Push an outline along ``axis``; it must be seen whole from its mean point.

    The outline holds the other two coordinates in their order x, y, z.
    """
    flat = np.asarray(outline, dtype=np.float64)
    return skin(np.stack([np.insert(flat, _AXES[axis], at, axis=1) for at in span]))


def sheet(surface: Float64[np.ndarray, "columns rows 3"], thickness: Vector) -> Mesh:
    """A thin skin: ``surface`` in front, the same moved by ``thickness`` behind."""
    behind = surface[:, ::-1] + np.array(thickness, dtype=np.float64)
    return skin(np.concatenate([surface, behind], axis=1))


def smooth(knots: Outline, count: int = 20) -> Float64[np.ndarray, "count 2"]:
    """Round an open outline: cubic between its knots, which are passed through."""
    points = np.asarray(knots, dtype=np.float64)
    at = np.linspace(0, len(points) - 1, count)
    left = np.minimum(at.astype(int), len(points) - 2)
    s = (at - left)[:, None]
    slopes = np.gradient(points, axis=0)
    rise = points[left + 1] - points[left]
    start, end = slopes[left] - rise, rise - slopes[left + 1]
    rounded: Float64[np.ndarray, "count 2"]
    rounded = points[left] + s * rise + s * (1 - s) * ((1 - s) * start + s * end)
    return rounded
