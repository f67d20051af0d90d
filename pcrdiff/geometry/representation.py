"""Ways to write a pose as a vector: what Table 4 diffuses, and more.

Each has a dimension, an encoder and a decoder; the decoder accepts any vector, so that a network
may answer with any. ``tidy`` rescales a vector to that of a pose where only the scale is wrong (a
quaternion not of unit length), and leaves it alone elsewhere.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.geometry.procrustes import nearest_rotation
from pcrdiff.geometry.rigid import Transforms, from_parts, from_pose_vector, pose_vector
from pcrdiff.geometry.rotation import (
    conjugate,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    multiply_quaternions,
    quaternion_from_matrix,
)
from pcrdiff.geometry.twist import exp_twist, log_twist

RepresentationName = Literal[
    "quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix"
]


def unchanged(vector: Float[Tensor, "*batch dim"]) -> Float[Tensor, "*batch dim"]:
    """The vector itself."""
    return vector


@dataclass(frozen=True)
class Representation:
    """One way to write T_target_source."""

    dim: int
    encode: Callable[[Tensor], Tensor]
    """T ``[*batch 4 4]`` to its vector ``[*batch dim]``."""
    decode: Callable[[Tensor], Tensor]
    """Any vector to a T."""
    tidy: Callable[[Tensor], Tensor] = unchanged

    @property
    def identity(self) -> Float[Tensor, " dim"]:
        """The vector of the pose that moves nothing."""
        return self.encode(torch.eye(4))


def unit_quaternion(vector: Float[Tensor, "*batch 7"]) -> Float[Tensor, "*batch 7"]:
    """The same translation, and the quaternion of unit length."""
    return torch.cat([normalize(vector[..., :4], dim=-1), vector[..., 4:]], dim=-1)


def euler_vector(T_target_source: Transforms) -> Float[Tensor, "*batch 6"]:
    """``(rx, ry, rz, tx, ty, tz)`` with R = Rx Ry Rz, in radians: the paper's 6-vector."""
    angles = euler_from_matrix(T_target_source[..., :3, :3])
    return torch.cat([angles, T_target_source[..., :3, 3]], dim=-1)


def from_euler_vector(vector: Float[Tensor, "*batch 6"]) -> Transforms:
    """Inverse of :func:`euler_vector`."""
    return from_parts(matrix_from_euler(vector[..., :3]), vector[..., 3:])


def columns_vector(T_target_source: Transforms) -> Float[Tensor, "*batch 9"]:
    """The first two columns of R, then t (Zhou et al. 2019, Eq. 15): continuous over SO(3)."""
    return T_target_source[..., :3, [0, 1, 3]].mT.flatten(-2)


def from_columns_vector(vector: Float[Tensor, "*batch 9"]) -> Transforms:
    """Gram-Schmidt on the two columns (Zhou et al. 2019, Eq. 16)."""
    first, second, t = vector[..., :3], vector[..., 3:6], vector[..., 6:]
    x = normalize(first, dim=-1)
    y = normalize(second - (x * second).sum(dim=-1, keepdim=True) * x, dim=-1)
    return from_parts(torch.stack([x, y, torch.linalg.cross(x, y)], dim=-1), t)


def dual_quaternion(T_target_source: Transforms) -> Float[Tensor, "*batch 8"]:
    """``(q, 1/2 t q)`` with the translation as a quaternion (0, t); q is unit, its w >= 0."""
    real = quaternion_from_matrix(T_target_source[..., :3, :3])
    t = torch.cat([torch.zeros_like(real[..., :1]), T_target_source[..., :3, 3]], dim=-1)
    return torch.cat([real, 0.5 * multiply_quaternions(t, real)], dim=-1)


def from_dual_quaternion(vector: Float[Tensor, "*batch 8"]) -> Transforms:
    """``t = 2 d q*``; scaling the eight numbers changes nothing.

    Raises:
        ValueError: The real quaternion is zero.
    """
    R = matrix_from_quaternion(vector[..., :4])
    unit = unit_dual_quaternion(vector)
    return from_parts(R, 2 * multiply_quaternions(unit[..., 4:], conjugate(unit[..., :4]))[..., 1:])


def unit_dual_quaternion(vector: Float[Tensor, "*batch 8"]) -> Float[Tensor, "*batch 8"]:
    """All eight numbers scaled so that the real quaternion has unit length."""
    length: Tensor = vector[..., :4].norm(dim=-1, keepdim=True)
    return vector / length.clamp(min=1e-12)


def rows_vector(T_target_source: Transforms) -> Float[Tensor, "*batch 12"]:
    """The upper three rows of the matrix; the fourth never varies."""
    return T_target_source[..., :3, :].flatten(-2)


def from_rows_vector(vector: Float[Tensor, "*batch 12"]) -> Transforms:
    """The rotation nearest to the 3x3 block, and the last column as it is."""
    rows = vector.reshape(*vector.shape[:-1], 3, 4)
    return from_parts(nearest_rotation(rows[..., :3]), rows[..., 3])


REPRESENTATIONS: dict[RepresentationName, Representation] = {
    "quaternion": Representation(7, pose_vector, from_pose_vector, unit_quaternion),
    "euler": Representation(6, euler_vector, from_euler_vector),
    "rotation_6d": Representation(9, columns_vector, from_columns_vector),
    "twist": Representation(6, log_twist, exp_twist),
    "dual_quaternion": Representation(
        8, dual_quaternion, from_dual_quaternion, unit_dual_quaternion
    ),
    "matrix": Representation(12, rows_vector, from_rows_vector),
}
