"""Rigid transforms ``T_target_source``: acting on points, inverting, and as 7-vectors."""

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.geometry.rotation import (
    Rotations,
    Vectors3,
    matrix_from_quaternion,
    quaternion_from_matrix,
)

Transforms = Float[Tensor, "*batch 4 4"]

TOLERANCE = 1e-6  # of the entries of R R^T of a pose that a library found


def from_parts(R: Rotations, t: Vectors3) -> Transforms:
    """The 4x4 transform ``x -> R x + t`` (Eq. 2)."""
    bottom = torch.tensor([0.0, 0.0, 0.0, 1.0]).to(R).expand(*R.shape[:-2], 1, 4)
    return torch.cat([torch.cat([R, t.unsqueeze(-1)], dim=-1), bottom], dim=-2)


def transform(
    T_target_source: Transforms, points: Float[Tensor, "*batch points 3"]
) -> Float[Tensor, "*batch points 3"]:
    """Carry points from the source frame into the target frame (Eq. 3)."""
    return points @ T_target_source[..., :3, :3].mT + T_target_source[..., None, :3, 3]


def invert(T_target_source: Transforms) -> Transforms:
    """``T_source_target``."""
    R_inverse = T_target_source[..., :3, :3].mT
    t = T_target_source[..., :3, 3]
    return from_parts(R_inverse, -(R_inverse @ t.unsqueeze(-1)).squeeze(-1))


def centroid_shift(
    source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"]
) -> Float64[Tensor, "4 4"]:
    """The pose that lays the source's centroid on the target's and turns nothing."""
    shift = (target.mean(dim=-2) - source.mean(dim=-2)).double()
    return from_parts(torch.eye(3).to(shift), shift)


def centred(points: Float[Tensor, "n 3"]) -> tuple[Float64[Tensor, "n 3"], Float64[Tensor, "4 4"]]:
    """The cloud about its own centroid, and the pose that carries it back."""
    mean = points.double().mean(dim=0)
    return points.double() - mean, from_parts(torch.eye(3).to(mean), mean)


def check_pose(who: str, pose: Float64[np.ndarray, "4 4"]) -> Float64[Tensor, "4 4"]:
    """The pose that a library found, as a tensor.

    Raises:
        ValueError: It is not finite, or not rigid.
    """
    R = pose[:3, :3]
    rigid = np.abs(R @ R.T - np.eye(3)).max() <= TOLERANCE and np.linalg.det(R) > 0
    if not (rigid and np.isfinite(pose).all() and (pose[3] == np.eye(4)[3]).all()):
        raise ValueError(f"{who} needs a rigid pose from its library, got {pose.tolist()}")
    return torch.from_numpy(pose)


def pose_vector(T_target_source: Transforms) -> Float[Tensor, "*batch 7"]:
    """``(qw, qx, qy, qz, tx, ty, tz)`` with a unit quaternion, ``qw >= 0`` (Sec. 3.5)."""
    quaternion = quaternion_from_matrix(T_target_source[..., :3, :3])
    return torch.cat([quaternion, T_target_source[..., :3, 3]], dim=-1)


def from_pose_vector(vector: Float[Tensor, "*batch 7"]) -> Transforms:
    """Inverse of :func:`pose_vector`; the quaternion part need not have unit length.

    Raises:
        ValueError: A quaternion part is zero.
    """
    return from_parts(matrix_from_quaternion(vector[..., :4]), vector[..., 4:])
