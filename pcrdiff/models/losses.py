"""What training minimises: Eqs. (15)-(17) and the terms of RPM-Net."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad

from pcrdiff.geometry.neighbors import row_argmax, squared_distances
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.registration import Poses, Scalar, Sources, Targets

INLIER_WEIGHT = 0.01  # Yew & Lee 2020, Sec. 4.4
SAME_PLACE, LEAST_NEAR = 0.04, 0.3
"""Deviation of a counterpart's place in the unit sphere; how near, in all, counterparts must be."""
ROUND = 1e-4  # cloud units; below it a distance is too short to have a direction


def diffusion_loss(
    prediction: Float[Tensor, "batch dim"], x_0: Float[Tensor, "batch dim"]
) -> Scalar:
    """``1/2 |f_theta(x_t, t) - x_0|^2``, mean over the batch (Eq. 15)."""
    return 0.5 * (prediction - x_0).square().sum(dim=-1).mean()


def chamfer_loss(moved: Sources, target: Targets) -> Scalar:
    """Mean squared distance to the nearest point, both ways, mean over the batch (Eq. 16).

    The nearest point is found without a graph: the gradient of a minimum passes through the
    point that attains it, and through no other.
    """
    forward = (moved - _nearest(moved.detach(), target)).square().sum(dim=-1)
    backward = (target - _nearest(target, moved)).square().sum(dim=-1)
    return forward.mean() + backward.mean()


def _nearest(queries: Sources, points: Targets) -> Sources:
    """The point nearest to each query.

    ``q.p - |p|^2 / 2`` is largest where the distance is smallest: one matrix product and a search
    along its rows, cloud by cloud.
    """
    with torch.no_grad():
        halves = 0.5 * points.square().sum(dim=-1, keepdim=True)
        closeness = pad(queries, (0, 1), value=1.0), torch.cat([points, -halves], dim=-1).mT
        index = torch.stack([row_argmax(q @ p) for q, p in zip(*closeness, strict=True)])
    return points.gather(1, index.unsqueeze(-1).expand(-1, -1, 3))


def pose_loss(T_estimate: Poses, T_truth: Poses) -> Scalar:
    """``|G_0^-1 G_gt - I|_F``, mean over the batch (Eq. 17)."""
    difference = invert(T_estimate) @ T_truth - torch.eye(4).to(T_truth)
    norm: Tensor = torch.linalg.matrix_norm(difference)
    return norm.mean()


def point_loss(estimated: Sources, true: Sources) -> Scalar:
    """Mean absolute distance between a cloud under two poses (Yew & Lee 2020, Eq. 10)."""
    return (estimated - true).abs().mean()


def inlier_loss(matches: Float[Tensor, "batch n m"]) -> Scalar:
    """How far rows and columns of the matches fall short of 1 (Yew & Lee 2020, Eq. 11)."""
    return (1 - matches.sum(dim=-1)).mean() + (1 - matches.sum(dim=-2)).mean()


@dataclass(frozen=True)
class Counterparts:
    """Which points of two clouds are the same place; a row or a column without any is zero."""

    of_source: Float[Tensor, "batch n m"]
    """Each row's shares in the target's points."""
    of_target: Float[Tensor, "batch n m"]
    """Each column's shares in the source's."""


@torch.no_grad()
def counterparts(moved: Sources, target: Targets) -> Counterparts:
    """The points of the other cloud near a point, by a Gaussian of their distance.

    A point whose counterparts weigh less than ``LEAST_NEAR`` has none: it lies in no overlap.

    Args:
        moved: The source under the true pose.
        target: The target.
    """
    squares = squared_distances(moved, target)
    near = torch.exp(squares / (-2 * SAME_PLACE**2)) * (squares < (2.5 * SAME_PLACE) ** 2)
    rows, columns = near.sum(dim=-1, keepdim=True), near.sum(dim=-2, keepdim=True)
    shares = [
        near / total.clamp(min=LEAST_NEAR) * (total > LEAST_NEAR) for total in (rows, columns)
    ]
    return Counterparts(*shares)


def match_loss(scores: Float[Tensor, "batch n m"], true: Counterparts) -> Scalar:
    """Cross-entropy of each point's true counterparts, both ways, mean over points and batch.

    A point chooses among the other cloud's points and a slack of score 0, which is right for one
    without a counterpart (as in SuperGlue, Sarlin et al. 2020, Eq. 10).
    """
    (_, n, m), batch = scores.shape, len(scores)
    slack = scores.new_zeros(batch, n, 1), scores.new_zeros(batch, 1, m)
    of_source = torch.cat([scores, slack[0]], dim=-1).logsumexp(dim=-1).mean()
    of_target = torch.cat([scores, slack[1]], dim=-2).logsumexp(dim=-2).mean()
    agreed = (true.of_source / n + true.of_target / m) * scores
    return of_source + of_target - agreed.sum() / batch


def rotation_loss(T_estimate: Poses, T_truth: Poses) -> Scalar:
    """Mean square of the entries of ``R^T R_gt - I`` (Wang & Solomon 2019, Eq. 16)."""
    R, R_truth = T_estimate[:, :3, :3], T_truth[:, :3, :3]
    return (R.mT @ R_truth - torch.eye(3).to(R)).square().mean()


def translation_loss(T_estimate: Poses, T_truth: Poses) -> Scalar:
    """Mean square of the entries of ``t - t_gt`` (Wang & Solomon 2019, Eq. 16)."""
    return (T_estimate[:, :3, 3] - T_truth[:, :3, 3]).square().mean()


def matching_losses(
    steps: Sequence[tuple[Poses, Float[Tensor, "batch n m"]]], T_truth: Poses, source: Sources
) -> dict[str, Scalar]:
    """RPM-Net's loss of a pose found step by step (Yew & Lee 2020, Sec. 4.4).

    Args:
        steps: The pose and the matches after each step; the last one weighs 1, each one before
            it half of the next.
        T_truth: The true T_target_source.
        source: The points that both poses move.
    """
    weights = [0.5 ** (len(steps) - 1 - i) for i in range(len(steps))]
    true = transform(T_truth, source)
    points = [
        w * point_loss(transform(T, source), true) for w, (T, _) in zip(weights, steps, strict=True)
    ]
    inliers = [w * inlier_loss(matches) for w, (_, matches) in zip(weights, steps, strict=True)]
    return {
        "points": torch.stack(points).sum(),
        "inliers": INLIER_WEIGHT * torch.stack(inliers).sum(),
    }


def nearest_distance(queries: Sources, points: Targets) -> Scalar:
    """Mean distance from a query to its nearest point, mean over the batch.

    One direction of :func:`chamfer_loss`, not squared. Within ``ROUND`` the gradient fades.
    """
    squares = (queries - _nearest(queries.detach(), points)).square().sum(dim=-1)
    return (squares + ROUND**2).sqrt().mean()
