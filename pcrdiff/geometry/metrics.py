"""How far an estimated pose is from the true one. Angles leave here in degrees."""

import torch
from jaxtyping import Bool, Float, Float64
from torch import Tensor

from pcrdiff.geometry.neighbors import nearest
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.geometry.rotation import euler_from_matrix, geodesic_angle

Poses = Float64[Tensor, "pairs 4 4"]
RIGHT_DEG, RIGHT_T = 5.0, 0.1
"""An answer that is off by less than this is right; the length is a tenth of the cloud's radius."""
CHAMFER_WITHIN = 1.1
"""An answer succeeds whose modified Chamfer distance is at most so many times the true pose's."""
LEAST_CHAMFER = 1e-14
"""Squared length that the rounding of coordinates to float32 leaves in the unit sphere."""


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


def modified_chamfer(
    estimate: Poses,
    truth: Poses,
    source: Float[Tensor, "pairs n 3"],
    target: Float[Tensor, "pairs m 3"],
    shape: Float[Tensor, "pairs points 3"],
) -> Float64[Tensor, " pairs"]:
    """How far the clouds lie from the whole, clean shape of each other, the metric of Yew & Lee (2020).

    ``mean_p min_q |T p - q|^2 + mean_q min_p |T p - q|^2``, where the first minimum is over the clean
    target and the second over the clean source. A shape turned by its own symmetry is as near.

    Args:
        estimate: T, the T_target_source that is measured.
        truth: The true one, which carries the clean source into the clean target.
        source: Points p as the method was shown them.
        target: Points q as the method was shown them.
        shape: The clean source: the whole shape in the source's frame.

    Returns:
        A squared length.
    """
    clean = shape.double()
    on_target = transform(invert(truth) @ estimate, source.double())  # |T p - G s| = |G^-1 T p - s|
    on_source = transform(invert(estimate), target.double())  # |T s - q| = |s - T^-1 q|
    squared, _ = nearest(torch.cat([on_target, on_source], dim=1), clean, k=1)
    of_source, of_target = torch.tensor_split(squared, [source.shape[1]], dim=1)
    return of_source.mean(dim=(1, 2)) + of_target.mean(dim=(1, 2))


def chamfer_ratio(
    estimate: Poses,
    truth: Poses,
    source: Float[Tensor, "pairs n 3"],
    target: Float[Tensor, "pairs m 3"],
    shape: Float[Tensor, "pairs points 3"],
) -> Float64[Tensor, " pairs"]:
    """:func:`modified_chamfer` of the estimate over that of the truth, or ``LEAST_CHAMFER`` if larger."""
    ours, true = (modified_chamfer(T, truth, source, target, shape) for T in (estimate, truth))
    return ours / true.clamp(min=LEAST_CHAMFER)
