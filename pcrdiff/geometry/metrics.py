"""How far an estimated pose is from the true one. Angles leave here in degrees."""

import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from pcrdiff.geometry.rotation import euler_from_matrix, geodesic_angle

Poses = Float64[Tensor, "pairs 4 4"]
RIGHT_DEG, RIGHT_T = 5.0, 0.1
"""An answer that is off by less than this is right; the length is a tenth of the cloud's radius."""


def error_r_deg(estimate: Poses, truth: Poses) -> Float64[Tensor, " pairs"]:
    """Isotropic rotation error: Eq. (18), with the ``- 1`` that it lacks, in degrees."""
    angle = geodesic_angle(truth[:, :3, :3], estimate[:, :3, :3])
    return angle * (180 / torch.pi)


def error_t(estimate: Poses, truth: Poses) -> Float64[Tensor, " pairs"]:
    """Isotropic translation error (Eq. 18), in the clouds' own unit."""
    distance: Tensor = translation_difference(estimate, truth).norm(dim=-1)
    return distance


def euler_difference_deg(estimate: Poses, truth: Poses) -> Float64[Tensor, "pairs 3"]:
    """Estimate minus truth of the angles in ``Rx Ry Rz``, in degrees, not wrapped.

    The field's RMSE(R) and MAE(R) are taken over these, all pairs and axes together.
    """
    estimated = euler_from_matrix(estimate[:, :3, :3])
    return (estimated - euler_from_matrix(truth[:, :3, :3])).rad2deg()


def translation_difference(estimate: Poses, truth: Poses) -> Float64[Tensor, "pairs 3"]:
    """Estimate minus truth of the translation, axis by axis."""
    return estimate[:, :3, 3] - truth[:, :3, 3]


def is_right(estimate: Poses, truth: Poses) -> Bool[Tensor, " pairs"]:
    """Whether an answer is off by less than ``RIGHT_DEG`` and ``RIGHT_T``, in the unit sphere."""
    return (error_r_deg(estimate, truth) < RIGHT_DEG) & (error_t(estimate, truth) < RIGHT_T)
