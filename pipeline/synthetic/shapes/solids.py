"""The mesh toolkit: the solids that shapes, rooms and streets are put together from.

Lengths are metres, z is up, the front of an object looks towards -y, angles are degrees.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from pcrdiff.clouds.surface import Mesh

Real = float | int  # spelt out: beartype knows no numeric tower
Span = tuple[Real, Real]
Row = Sequence[Real]
"""Of a table of boxes or ovals: sizes, then places."""
Vector = Sequence[Real] | Float64[np.ndarray, "3"]
Outline = Sequence[Sequence[Real] | Float64[np.ndarray, "2"]] | Float64[np.ndarray, "_ 2"]
Path = Sequence[Vector] | Float64[np.ndarray, "_ 3"]
Axis = Literal["x", "y", "z"]

_FLAT = 1e-9  # of the squared extent: a face smaller than this is a seam, not a face
_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_BOX_FACES = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ],
    dtype=np.int64,
)


def join(*parts: Mesh) -> Mesh:
    """Put parts into one mesh; what overlaps stays overlapping, as in most CAD models."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    return Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=True)]),
    )


def place(part: Mesh, at: Vector, yaw_deg: Real = 0) -> Mesh:
    """Turn a part counter-clockwise about the vertical, then shift it by ``at``."""
    turned = turn(part, "z", yaw_deg) if yaw_deg else part
    return Mesh(turned.vertices + np.asarray(at, dtype=np.float64), turned.faces)


def turn(part: Mesh, axis: Axis, angle_deg: Real, about: Vector = (0, 0, 0)) -> Mesh:
    """Turn a part about the line through ``about`` along ``axis``, right-handed."""
    R = Rotation.from_euler(axis, angle_deg, degrees=True).as_matrix()
    centre = np.asarray(about, dtype=np.float64)
    return Mesh((part.vertices - centre) @ R.T + centre, part.faces)


def stretch(part: Mesh, factors: Vector) -> Mesh:
    """Scale a part along the axes about the origin; a negative factor mirrors it."""
    scale = np.asarray(factors, dtype=np.float64)
    mirrored = bool(np.prod(scale) < 0)
    return Mesh(part.vertices * scale, part.faces[:, ::-1] if mirrored else part.faces)


def both_sides(part: Mesh) -> Mesh:
    """A part and its mirror image to the left."""
    return join(part, stretch(part, (-1, 1, 1)))


def four(part: Mesh) -> Mesh:
    """A part at each of four corners about the z axis."""
    return both_sides(join(part, stretch(part, (1, -1, 1))))


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


def boxes(*rows: Row, taper: Span = (1, 1)) -> Mesh:
    """Boxes, a row each: width, depth, height, then x, y, z of the middle of its underside.

    The upper sides are ``taper`` times as wide and as deep as the undersides.
    """
    size, at = np.split(np.array(rows, dtype=np.float64)[:, None], 2, axis=-1)
    lower, upper = (
        np.column_stack([_CORNERS * share, np.full(4, z)]) for share, z in (((1, 1), 0), (taper, 1))
    )
    vertices = size * np.concatenate([lower, upper]) + at
    faces = _BOX_FACES + 8 * np.arange(len(rows))[:, None, None]
    return Mesh(vertices.reshape(-1, 3), faces.reshape(-1, 3))


def oval(
    width: Real, depth: Real, at: Vector, squareness: Real = 2, sides: int = 24
) -> Float64[np.ndarray, "sides 3"]:
    """A level ring about ``at``: an ellipse at squareness 2, nearly a rectangle at 8."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    cosine, sine = np.cos(angle), np.sin(angle)
    x = width / 2 * np.sign(cosine) * np.abs(cosine) ** (2 / squareness)
    y = depth / 2 * np.sign(sine) * np.abs(sine) ** (2 / squareness)
    return np.column_stack([x, y, np.zeros(sides)]) + np.asarray(at, dtype=np.float64)


def loft(rows: Sequence[Row], squareness: Real = 2, sides: int = 24) -> Mesh:
    """A skin over ovals, a row each: width, depth, then x, y, z of its middle."""
    return skin(np.stack([oval(w, d, at, squareness, sides) for w, d, *at in rows]))


def cushion(size: Vector, at: Vector, squareness: Real = 5, sides: int = 20) -> Mesh:
    """A box with soft edges; ``at`` is the middle of its underside."""
    (width, depth, height), (x, y, z) = size, at
    soft = min(width, depth, height) * 0.3
    levels = [(0, soft), (soft / 2, 0), (height - soft / 2, 0), (height, soft)]
    rows = [(width - inset, depth - inset, x, y, z + level) for level, inset in levels]
    return loft(rows, squareness, sides)


def lathe(profile: Outline, sides: int = 24) -> Mesh:
    """Turn a profile of (radius, z), bottom first, about the z axis."""
    radius, height = np.asarray(profile, dtype=np.float64).T
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sides)])
    return skin(circle * radius[:, None, None] + np.array([0, 0, 1]) * height[:, None, None])


def hollow(outside: Outline, wall: Real, floor: Real, sides: int = 24) -> Mesh:
    """A vessel: the outside profile up, the inside one ``wall`` thinner back down to ``floor``."""
    outer = np.asarray(outside, dtype=np.float64)
    inner = outer[::-1] - np.array([wall, 0])
    inner = inner[inner[:, 1] > floor]
    inner[:, 0] = np.maximum(inner[:, 0], 0.3 * wall)
    return lathe(np.vstack([outer, inner, [[0.6 * inner[-1, 0], floor]]]), sides)


def ball(radii: Vector, at: Vector, sides: int = 12) -> Mesh:
    """An ellipsoid about ``at``."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 2)
    profile = np.column_stack([np.cos(angle), np.sin(angle)])
    return place(stretch(lathe(profile, sides), radii), at)


def tube(path: Path, radius: Real | Sequence[Real], sides: int = 8) -> Mesh:
    """Sweep a circle along a path; ``radius`` is one for all, or one for each point of the path."""
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
        across = np.stack([normal, np.cross(tangent, normal)])
        rings.append(point + r * np.column_stack([np.cos(angle), np.sin(angle)]) @ across)
    return skin(np.stack(rings))


def rod(start: Vector, end: Vector, radius: Real, end_radius: Real | None = None) -> Mesh:
    """A straight round bar, thinner or thicker at its end if ``end_radius`` says so."""
    return tube([start, end], [radius, radius if end_radius is None else end_radius], sides=10)


def disc(axis: Axis, radius: Real, thickness: Real, at: Vector, sides: int = 20) -> Mesh:
    """A flat cylinder about ``at``, its axis along ``axis``."""
    half = np.eye(3)["xyz".index(axis)] * thickness / 2
    return tube(np.stack([-half, half]) + np.asarray(at, dtype=np.float64), radius, sides=sides)


def slab(outline: Outline, span: Span, axis: Axis = "z") -> Mesh:
    """Push an outline along ``axis``; it must be seen whole from its mean point.

    The outline holds the other two coordinates in their order x, y, z.
    """
    flat = np.asarray(outline, dtype=np.float64)
    return skin(np.stack([np.insert(flat, "xyz".index(axis), at, axis=1) for at in span]))


def sheet(surface: Float64[np.ndarray, "columns rows 3"], thickness: Vector) -> Mesh:
    """A thin skin: ``surface`` in front, the same moved by ``thickness`` behind."""
    behind = surface[:, ::-1] + np.asarray(thickness, dtype=np.float64)
    return skin(np.concatenate([surface, behind], axis=1))


def arc(
    radius: Real, start_deg: Real, stop_deg: Real, count: int = 10
) -> Float64[np.ndarray, "count 2"]:
    """Points of an arc about the origin, counted from the first axis towards the second."""
    angle = np.deg2rad(np.linspace(start_deg, stop_deg, count))
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def smooth(knots: Outline, count: int = 20) -> Float64[np.ndarray, "count 2"]:
    """Round an open outline: cubic between its knots, which are passed through."""
    at = np.linspace(0, len(knots) - 1, count)
    rounded: Float64[np.ndarray, "count 2"]
    rounded = PchipInterpolator(np.arange(len(knots)), np.asarray(knots, dtype=np.float64))(at)
    return rounded
