"""Closed-form rigid alignment of matched points."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.geometry.rotation import Rotations, vee
from pcrdiff.geometry.twist import hat

LEAST_LEVER = 1e-6  # keeps the turn finite where several rotations are equally near


def fit_rigid(
    source: Float[Tensor, "batch points 3"],
    target: Float[Tensor, "batch points 3"],
    weights: Float[Tensor, "batch points"],
) -> Float[Tensor, "batch 4 4"]:
    """Fit the rigid transform that best carries ``source`` onto ``target``.

    Minimises ``sum_i w_i |R p_i + t - q_i|^2`` over SE(3): Eq. (1) of the paper, with the
    matches given row by row. Solved by SVD (Kabsch 1976), reflections removed.
    The gradient is finite even where the matches fix no rotation: in early training, say.

    Args:
        source: Points p_i, in the source frame.
        target: Their matches q_i, in the target frame; same length unit as ``source``.
        weights: w_i >= 0. Only their ratios matter.

    Returns:
        T_target_source.

    Raises:
        ValueError: A batch item has no positive weight, so any pose would fit it.
    """
    total = weights.sum(dim=-1, keepdim=True)
    if not (total > 0).all():
        empty = (~(total[:, 0] > 0)).nonzero().flatten().tolist()
        raise ValueError(f"fit_rigid needs a positive weight per item; items {empty} have none")
    w = (weights / total).unsqueeze(-1)
    p_mean, q_mean = (w * source).sum(dim=-2), (w * target).sum(dim=-2)
    p, q = source - p_mean.unsqueeze(-2), target - q_mean.unsqueeze(-2)
    R = nearest_rotation((w * q).mT @ p)
    return from_parts(R, q_mean - (R @ p_mean.unsqueeze(-1)).squeeze(-1))


def nearest_rotation(M: Rotations) -> Rotations:
    """The rotation R nearest to ``M`` in the Frobenius norm (special orthogonal Procrustes).

    Reflections are removed: det R = +1, whatever the noise did. An SVD's own gradient blows up where
    singular values are equal, as they are of every rotation. R itself is smooth there: with ``M = R S``, S symmetric, a change of M turns R by the solution
    x of ``(tr(S) I - S) x = vee(R^T M)``, which is zero at M itself.
    """
    with torch.no_grad():
        U, _, Vh = torch.linalg.svd(M)
        U = torch.cat([U[..., :2], U[..., 2:] * torch.det(U @ Vh).sign()[..., None, None]], dim=-1)
        R: Tensor = U @ Vh
        if not M.requires_grad:
            return R
        S = R.mT @ M
        trace = S.diagonal(dim1=-2, dim2=-1).sum(dim=-1)[..., None, None]
        lever = (trace + LEAST_LEVER) * torch.eye(3).to(M) - S
    turn: Tensor = torch.linalg.solve(lever, vee(R.mT @ M))
    turned: Tensor = R + R @ hat(turn)
    return turned
