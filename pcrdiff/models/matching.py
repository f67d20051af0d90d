"""Soft matches of two clouds and the pose that fits them (Yew & Lee 2020, RPM-Net)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad, softplus

from pcrdiff.geometry.neighbors import BLOCK
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import from_parts
from pcrdiff.models.mlp import he_layers
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.sinkhorn import sinkhorn, sinkhorn_product
from pcrdiff.registration import Poses, Sources, Targets

LEAST_WEIGHT = 1e-5  # RPM-Net's; next to a sum of matches, which is about 1


class AnnealingNet(nn.Module):
    """Reads from both clouds how sharp (beta) and how generous (alpha) the matching may be."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, 1024), ins=4)
        self.head = nn.Sequential(*he_layers(1024, (512, 256)), nn.Linear(256, 2))

    def forward(
        self, source: Sources, target: Targets
    ) -> tuple[Float[Tensor, " batch"], Float[Tensor, " batch"]]:
        """(alpha, beta), both positive, one of each per pair."""
        flagged = torch.cat([pad(source, (0, 1), value=0.0), pad(target, (0, 1), value=1.0)], 1)
        beta, alpha = softplus(self.head(self.encoder(flagged))).unbind(-1)
        return alpha, beta


@dataclass(frozen=True)
class Matchable:
    """Two clouds and what their soft matches are made of."""

    source: Sources
    target: Targets
    source_features: Float[Tensor, "batch n dim"]
    target_features: Float[Tensor, "batch m dim"]
    alpha: Float[Tensor, " batch"]
    beta: Float[Tensor, " batch"]

    def factors(self) -> tuple[Float[Tensor, "batch n factors"], Float[Tensor, "batch m factors"]]:
        """Whose product the scores are: all of ``|x|^2 - 2 xy + |y|^2`` in one sum of products.

        Features are counted from the target's mean, on which no distance depends: the smaller
        they are, the less of a distance is lost between its large terms.
        """
        middle = self.target_features.detach().mean(dim=1, keepdim=True)
        x, y = self.source_features - middle, self.target_features - middle
        beta, alpha = self.beta[:, None, None], self.alpha[:, None, None]
        squares, others = (f.square().sum(dim=-1, keepdim=True) for f in (x, y))
        left = torch.cat([2 * beta * x, beta * (alpha - squares), torch.ones_like(squares)], -1)
        return left, torch.cat([y, torch.ones_like(others), -beta * others], -1)

    def scores(self) -> Float[Tensor, "batch n m"]:
        """``-beta (|f_x - f_y|^2 - alpha)``, the logarithm of the unnormalised matches."""
        left, right = self.factors()
        return left @ right.mT

    def matches(self, iterations: int) -> Float[Tensor, "batch n m"]:
        """:func:`sinkhorn` of the scores, all of them at once."""
        return sinkhorn(self.scores(), iterations)

    def fit(self, iterations: int) -> Poses:
        """:func:`fit_matches` of :meth:`matches`; without a graph, in memory linear in N + M."""
        n, m = self.source.shape[1], self.target.shape[1]
        if torch.is_grad_enabled() or n * m <= BLOCK:
            return fit_matches(self.source, self.target, self.matches(iterations))
        middle = self.target.mean(dim=1, keepdim=True)
        values = pad(self.target - middle, (0, 1), value=1.0)
        pairs = zip(*self.factors(), values, strict=True)
        sums = torch.stack([sinkhorn_product(*pair, iterations) for pair in pairs])
        return _fit_sums(self.source, middle, sums[..., :3], sums[..., 3])


def fit_matches(source: Sources, target: Targets, matches: Float[Tensor, "batch n m"]) -> Poses:
    """T_target_source that carries each source point to the mean of its matches, by their weight.

    Yew & Lee 2020, Eqs. 4-5. A point that matches nothing has no weight.
    """
    middle = target.mean(dim=1, keepdim=True)
    return _fit_sums(source, middle, matches @ (target - middle), matches.sum(dim=-1))


def _fit_sums(
    source: Sources,
    middle: Float[Tensor, "batch 1 3"],
    pulls: Sources,
    weights: Float[Tensor, "batch n"],
) -> Poses:
    """:func:`fit_matches`, given the rows' sums: of the matches, and of those times the target.

    The target counts from its ``middle``: where a cloud lies should cost its shape no digits.
    """
    matched = (pulls - LEAST_WEIGHT * middle) / (weights.unsqueeze(-1) + LEAST_WEIGHT)
    eye = torch.eye(3).to(middle).expand(len(middle), 3, 3)
    return from_parts(eye, middle.squeeze(1)) @ fit_rigid(source, matched, weights + 1e-8)
