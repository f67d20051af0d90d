"""Soft matches of two clouds: annealing parameters and Sinkhorn (Yew & Lee 2020, RPM-Net)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad, softplus

from pcrdiff.geometry.neighbors import squared_distances
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.models.mlp import he_layers
from pcrdiff.models.pointnet import PointNet

LEAST_SLACK = 1e-30  # next to a row's best match; its inverse is still a float32


class AnnealingNet(nn.Module):
    """Reads from both clouds how sharp (beta) and how generous (alpha) the matching may be."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, 1024), ins=4)
        self.head = nn.Sequential(*he_layers(1024, (512, 256)), nn.Linear(256, 2))

    def forward(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> tuple[Float[Tensor, " batch"], Float[Tensor, " batch"]]:
        """(alpha, beta), both positive, one of each per pair."""
        flagged = torch.cat([pad(source, (0, 1), value=0.0), pad(target, (0, 1), value=1.0)], 1)
        beta, alpha = softplus(self.head(self.encoder(flagged))).unbind(-1)
        return alpha, beta


def match_scores(
    source: Float[Tensor, "batch n dim"],
    target: Float[Tensor, "batch m dim"],
    alpha: Float[Tensor, " batch"],
    beta: Float[Tensor, " batch"],
) -> Float[Tensor, "batch n m"]:
    """``-beta (|f_x - f_y|^2 - alpha)``, the logarithm of the unnormalised matches."""
    distances = squared_distances(source, target)
    return -beta[:, None, None] * (distances - alpha[:, None, None])


def sinkhorn(scores: Float[Tensor, "batch n m"], iterations: int) -> Float[Tensor, "batch n m"]:
    """Matches whose rows and columns sum to at most 1, the rest being in a slack row and column.

    A row is normalised together with its slack place, a column with its own; the slack row and
    column themselves never are, so a point without a match finds room there. The matches are
    ``exp(scores)`` with each row and each column scaled, so only the scales are iterated. A row
    is measured against its largest score, or against the slack where that is larger. A column
    never sums to more than 1, a row only until the iterations have settled.
    """
    largest = scores.detach().amax(dim=-1, keepdim=True).clamp(min=0)
    kernel = (scores - largest).exp()
    slack = (-largest).exp().clamp(min=LEAST_SLACK)
    columns = torch.ones_like(kernel[:, :1, :])
    for _ in range(iterations):
        rows = 1 / (kernel @ columns.mT + slack)
        columns = 1 / (rows.mT @ kernel + 1)
    return rows * kernel * columns


def fit_matches(
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    matches: Float[Tensor, "batch n m"],
) -> Float[Tensor, "batch 4 4"]:
    """T_target_source that carries each source point to the mean of its matches, by their weight.

    Yew & Lee 2020, Eqs. 4-5. A point that matches nothing pulls at nothing.
    """
    weights = matches.sum(dim=-1)
    matched = (matches @ target) / (weights.unsqueeze(-1) + 1e-5)
    return fit_rigid(source, matched, weights + 1e-8)


def fit_pointers(
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    source_features: Float[Tensor, "batch n dim"],
    target_features: Float[Tensor, "batch m dim"],
) -> Float[Tensor, "batch 4 4"]:
    """T_target_source that carries each source point to where it points among the target's.

    Wang & Solomon 2019 (DCP), Eqs. 10-15: a softmax over the target's points of the scaled dot
    products of the features, and a fit in which every source point weighs the same.
    """
    scores = source_features @ target_features.mT / source_features.shape[-1] ** 0.5
    return fit_rigid(source, scores.softmax(dim=-1) @ target, torch.ones_like(source[..., 0]))
