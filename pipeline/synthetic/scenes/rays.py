"""Casting rays at meshes: what a camera or a lidar sees of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from pcrdiff.bindings.open3d import open3d
from pcrdiff.clouds.surface import Mesh


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
