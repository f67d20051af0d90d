"""What is done to a cloud before it becomes one side of a pair: one function each."""

import numpy as np
import torch
from jaxtyping import Float64

from pcrdiff.geometry.rigid import transform

SampledCloud = Float64[np.ndarray, "points channels"]
"""Points in three channels; where the data set gives unit normals, these in three more."""


def jitter(
    points: SampledCloud, deviation: float, clip: float, *, generator: np.random.Generator
) -> SampledCloud:
    """Add normal noise to every coordinate, clipped at ``clip``; lengths in the cloud's unit.

    Normals stay as they are: given ones are those of the clean surface.
    """
    noise = generator.normal(0.0, deviation, (len(points), 3))
    noisy = points.copy()
    noisy[:, :3] += np.clip(noise, -clip, clip, out=noise)
    return noisy


def crop(
    points: SampledCloud, keep: float, *, generator: np.random.Generator
) -> Float64[np.ndarray, "kept channels"]:
    """Keep the share ``keep`` of the points that lies furthest along a random direction.

    The half-space crop of Yew & Lee (2020); ``ceil(keep * points)`` points remain.

    Raises:
        ValueError: ``keep`` is not in (0, 1].
    """
    if not 0 < keep <= 1:
        raise ValueError(f"crop needs keep in (0, 1], got {keep}")
    direction = generator.normal(size=3)
    count = int(np.ceil(keep * len(points) - 1e-9))  # 0.55 * 100 is a little above 55
    if count == len(points):
        return points
    order = np.argsort(points[:, :3] @ direction, kind="stable")
    kept = np.sort(order[len(points) - count :])
    return points[kept]


def shuffle(points: SampledCloud, *, generator: np.random.Generator) -> SampledCloud:
    """The same points in a random order."""
    return points.take(generator.permutation(len(points)), axis=0)


def unit_sphere(points: SampledCloud) -> tuple[Float64[np.ndarray, "3"], float]:
    """Centre (the mean) and scale (the largest distance from it) of a cloud.

    Raises:
        ValueError: All points are one.
    """
    centre = points[:, :3].mean(axis=0)
    x, y, z = np.square(points[:, :3] - centre).T
    scale = float(np.sqrt((x + y + z).max()))
    if scale == 0:
        raise ValueError(f"unit_sphere needs a cloud with extent, got {len(points)} equal points")
    return centre, scale


def rescale(points: SampledCloud, centre: Float64[np.ndarray, "3"], scale: float) -> SampledCloud:
    """Make ``centre`` the origin and ``scale`` the unit of length."""
    return np.hstack([(points[:, :3] - centre) / scale, points[:, 3:]])


def move(points: SampledCloud, T_target_source: Float64[np.ndarray, "4 4"]) -> SampledCloud:
    """Carry points into the target frame (Eq. 3: Q = G P); normals are turned alone."""
    pose, rotation = torch.from_numpy(T_target_source), T_target_source[:3, :3]
    moved: SampledCloud = transform(pose, torch.from_numpy(points[:, :3])).numpy()
    has_normals = points.shape[1] == 6
    return np.hstack([moved, points[:, 3:] @ rotation.T]) if has_normals else moved
