"""What made-up scenes are built from: simple solids, putting them in place, and casting rays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from pcrdiff.bindings.open3d import open3d
from pcrdiff.data.raw import Mesh

# Eight corners, the lower four first, counter-clockwise; twelve triangles facing outwards.
_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
_HEXAHEDRON = np.array(
    [
        *([0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4]),
        *([1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]),
    ],
    dtype=np.int64,
)


def tapered(
    base: tuple[float, float],
    top: tuple[float, float],
    height: float,
    shift: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """A block whose top rectangle may differ from its base and sit aside of it by ``shift``.

    Like every solid here it stands on z = 0 with its base centred on the origin.
    """
    lower = np.column_stack([_CORNERS * base, np.zeros(4)])
    upper = np.column_stack([_CORNERS * top + shift, np.full(4, height)])
    return Mesh(np.concatenate([lower, upper]), _HEXAHEDRON)


def box(width: float, depth: float, height: float) -> Mesh:
    """A cuboid: ``width`` along x, ``depth`` along y, ``height`` along z."""
    return tapered((width, depth), (width, depth), height)


def frustum(lower: float, upper: float, height: float, sides: int = 12) -> Mesh:
    """A round column with radius ``lower`` at the bottom and ``upper`` at the top."""
    angles = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [
        np.column_stack([circle * radius, np.full(sides, z)])
        for radius, z in ((lower, 0.0), (upper, height))
    ]
    caps = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]])
    here = np.arange(sides)
    there = (here + 1) % sides
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [
        [here, there, there + sides],
        [here, there + sides, here + sides],
        [bottom, there, here],
        [top, here + sides, there + sides],
    ]
    return Mesh(
        np.concatenate([*rings, caps]),
        np.concatenate([np.column_stack(face) for face in faces]).astype(np.int64),
    )


def ball(rx: float, ry: float, rz: float, sides: int = 10) -> Mesh:
    """An ellipsoid with the given half axes, standing on z = 0."""
    polar = np.linspace(0.0, np.pi, sides // 2 + 1)
    around = np.linspace(0.0, 2 * np.pi, sides + 1)
    p, a = np.meshgrid(polar, around, indexing="ij")
    unit = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), 1 - np.cos(p)], axis=-1)
    return sheet(unit * [rx, ry, rz])


def sheet(grid: Float64[np.ndarray, "rows columns 3"]) -> Mesh:
    """The surface through a grid of points, two triangles a cell."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        corner.reshape(-1)
        for corner in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Mesh(grid.reshape(-1, 3), faces.astype(np.int64))


def leaves(
    radii: tuple[float, float, float], count: int, size: float, *, generator: np.random.Generator
) -> Mesh:
    """Foliage: ``count`` loose triangles of about ``size`` in an ellipsoid standing on z = 0.

    Rays find their way between the leaves, as they do in a real tree.
    """
    directions = generator.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = generator.uniform(0.25, 1.0, (count, 1)) ** 0.5  # leaves sit near the outside
    centres = directions * depth * radii + [0.0, 0.0, radii[2]]
    corners = centres[:, None] + size * generator.standard_normal((count, 3, 3)) / 2
    faces = np.arange(3 * count, dtype=np.int64).reshape(count, 3)
    return Mesh(corners.reshape(-1, 3), faces)


def placed(mesh: Mesh, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Mesh:
    """The mesh turned by ``yaw`` (radians) about the vertical, then moved to (x, y, z)."""
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Mesh(mesh.vertices @ R.T + [x, y, z], mesh.faces)


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(
            [mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]
        ),
    )


@dataclass(frozen=True)
class Hits:
    """Where rays met the scene first."""

    distance: Float64[np.ndarray, " rays"]
    """In lengths of the ray's direction; infinite where the ray met nothing."""
    part: Int64[np.ndarray, " rays"]
    """Which mesh of the scene was met; -1 for none."""
    cosine: Float64[np.ndarray, " rays"]
    """Of the angle between ray and surface normal: 1 head on, 0 grazing (or nothing met)."""


_tensor: Any = open3d.core.Tensor.from_numpy


class RayScene:
    """Meshes at which rays can be cast."""

    def __init__(self, parts: Sequence[Mesh]) -> None:
        self._scene: Any = open3d.t.geometry.RaycastingScene(nthreads=1)
        for part in parts:
            vertices = np.ascontiguousarray(part.vertices, dtype=np.float32)
            faces = np.ascontiguousarray(part.faces, dtype=np.uint32)
            self._scene.add_triangles(_tensor(vertices), _tensor(faces))

    def cast(
        self, origin: Float64[np.ndarray, "3"], directions: Float64[np.ndarray, "rays 3"]
    ) -> Hits:
        """Send rays from one point; ``directions`` need not have unit length."""
        origins = np.broadcast_to(origin, directions.shape)
        rays = np.concatenate([origins, directions], axis=-1).astype(np.float32)
        answer = self._scene.cast_rays(_tensor(rays), nthreads=1)
        part = answer["geometry_ids"].numpy().astype(np.int64)
        normals = answer["primitive_normals"].numpy().astype(np.float64)
        lengths = np.linalg.norm(directions, axis=-1)
        return Hits(
            distance=answer["t_hit"].numpy().astype(np.float64),
            part=np.where(part == open3d.t.geometry.RaycastingScene.INVALID_ID, -1, part),
            cosine=np.abs((normals * directions).sum(axis=-1)) / lengths,
        )
