"""Rigid transforms ``T_target_source``: acting on points, inverting, and as 7-vectors."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.rotation import matrix_from_quaternion, quaternion_from_matrix


def from_parts(
    R: Float[Tensor, "*batch 3 3"], t: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch 4 4"]:
    """The 4x4 transform ``x -> R x + t`` (Eq. 2)."""
    bottom = torch.tensor([0.0, 0.0, 0.0, 1.0]).to(R).expand(*R.shape[:-2], 1, 4)
    return torch.cat([torch.cat([R, t.unsqueeze(-1)], dim=-1), bottom], dim=-2)


def transform(
    T_target_source: Float[Tensor, "*batch 4 4"],
    points: Float[Tensor, "*batch points 3"],
) -> Float[Tensor, "*batch points 3"]:
    """Carry points from the source frame into the target frame (Eq. 3)."""
    return points @ T_target_source[..., :3, :3].mT + T_target_source[..., None, :3, 3]


def invert(T_target_source: Float[Tensor, "*batch 4 4"]) -> Float[Tensor, "*batch 4 4"]:
    """``T_source_target``."""
    R_inverse = T_target_source[..., :3, :3].mT
    t = T_target_source[..., :3, 3]
    return from_parts(R_inverse, -(R_inverse @ t.unsqueeze(-1)).squeeze(-1))


def pose_vector(T_target_source: Float[Tensor, "*batch 4 4"]) -> Float[Tensor, "*batch 7"]:
    """``(qw, qx, qy, qz, tx, ty, tz)`` with a unit quaternion, ``qw >= 0`` (Sec. 3.5)."""
    quaternion = quaternion_from_matrix(T_target_source[..., :3, :3])
    return torch.cat([quaternion, T_target_source[..., :3, 3]], dim=-1)


def from_pose_vector(vector: Float[Tensor, "*batch 7"]) -> Float[Tensor, "*batch 4 4"]:
    """Inverse of :func:`pose_vector`; the quaternion part need not have unit length.

    Raises:
        ValueError: A quaternion part is zero.
    """
    return from_parts(matrix_from_quaternion(vector[..., :4]), vector[..., 4:])
