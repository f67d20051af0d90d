"""DeepGMR (Yuan et al. 2020): two clouds as Gaussian mixtures, aligned component by component."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import mse_loss, normalize, one_hot

from pcrdiff.geometry.neighbors import gather_points, nearest, squared_distances
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import from_parts, invert, transform
from pcrdiff.models.mlp import he_layers, he_linear
from pcrdiff.models.structure import angle_between
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds

INWARD = 1e-3  # how a tie between neighbours is decided, see `describe_invariantly`
LEAST_SHARE = 1e-6  # a component without points has no weight, and its mean does not matter
LEAST_LEVER = 1e-6  # cloud units squared; keeps the turn finite where the pose is not unique
LEAST_VARIANCE = 1e-4  # cloud units squared; keeps one point from outweighing all others


@dataclass(frozen=True)
class Mixture:
    """A cloud as Gaussians; the j-th is the same part of the shape in every pose."""

    shares: Float[Tensor, "batch components"]
    means: Float[Tensor, "batch components 3"]
    variances: Float[Tensor, "batch components"]


class DeepGMR(LearnedMethod):
    """Sorts points into components by features that no rotation changes, then aligns once."""

    name = "deepgmr"

    def __init__(self, neighbours: int, feature_dim: int, components: int) -> None:
        """The authors' numbers: 20 neighbours, a feature of 1024, 16 components."""
        super().__init__()
        self.neighbours = neighbours
        self.per_point = nn.Sequential(*he_layers(3 * neighbours + 1, (64, 128, 256, feature_dim)))
        self.joint = he_linear(2 * feature_dim, 512)
        self.head = nn.Sequential(*he_layers(512, (256, 128)), nn.Linear(128, components))

    def assign(self, cloud: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch n components"]:
        """How much of each point belongs to each component (the network f_psi).

        ``joint`` acts on a point's feature beside the cloud's, which is the maximum over points;
        the cloud's half of the product is the same for all points and computed once.
        """
        local = self.per_point(describe_invariantly(cloud, self.neighbours))
        whole = local.amax(dim=-2, keepdim=True)
        for_local, for_whole = self.joint.weight.chunk(2, dim=1)
        joint = local @ for_local.mT + (whole @ for_whole.mT + self.joint.bias)
        gamma: Tensor = self.head(joint.relu()).softmax(dim=-1)
        return gamma

    def mix(self, cloud: Float[Tensor, "batch n 3"]) -> Mixture:
        """The mixture of a cloud, each component isotropic (block M_Theta)."""
        gamma = self.assign(cloud)
        shares = gamma.mean(dim=-2)
        points = (shares * cloud.shape[-2]).clamp(min=LEAST_SHARE).unsqueeze(-2)
        within = (gamma / points).mT
        means = within @ cloud
        spread = within * squared_distances(means, cloud)
        return Mixture(shares, means, spread.sum(dim=-1).clamp(min=LEAST_VARIANCE))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """How far both estimates, there and back, are from undoing the true pose."""
        del generator
        source, target = self.mix(pairs.source), self.mix(pairs.target)
        T_truth = pairs.T_target_source.to(pairs.source)
        eye = torch.eye(4).to(T_truth).expand_as(T_truth)
        there, back = align_differentiably(source, target), align_differentiably(target, source)
        return {
            "there": mse_loss(there @ invert(T_truth), eye),
            "back": mse_loss(back @ T_truth, eye),
        }

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """One pass; nothing is drawn."""
        del generator
        check_clouds(self.name, source, target, minimum=self.neighbours + 1)
        return align(self.mix(source), self.mix(target))


def align(source: Mixture, target: Mixture) -> Float[Tensor, "batch 4 4"]:
    """The pose under which the target's mixture explains the source's best (block M_T).

    A source component counts by its share, and the less the wider its counterpart is.
    """
    return fit_rigid(source.means, target.means, source.shares / target.variances)


def align_differentiably(source: Mixture, target: Mixture) -> Float[Tensor, "batch 4 4"]:
    """:func:`align` with a gradient that is finite wherever the pose is unique.

    That of an SVD is not: it divides by differences of singular values. At the pose the pull of
    all components is in balance; a change of theirs upsets it, and is answered by a small turn.
    """
    with torch.no_grad():
        T = align(source, target)
    w = (source.shares / target.variances).unsqueeze(-1)
    w = w / w.sum(dim=-2, keepdim=True)
    moved = transform(T, source.means)
    p_mean, q_mean = (w * moved).sum(dim=-2, keepdim=True), (w * target.means).sum(-2, keepdim=True)
    p, q = moved - p_mean, target.means - q_mean
    torque = (w * torch.linalg.cross(p, q)).sum(dim=-2)
    eye = torch.eye(3).to(p).expand(len(p), 3, 3)
    lever = ((w * p * q).sum(dim=(-2, -1)) + LEAST_LEVER)[:, None, None] * eye - (w * p).mT @ q
    turn = torch.linalg.solve(lever.detach(), torque)
    R = eye + torch.linalg.cross(turn.unsqueeze(-1).expand_as(eye), eye, dim=-2)
    return from_parts(R, (q_mean - p_mean @ R.mT).squeeze(-2)) @ T


@torch.no_grad()
def describe_invariantly(
    cloud: Float[Tensor, "batch n 3"], k: int
) -> Float[Tensor, "batch n 3*{k}+1"]:
    """Rotation-invariant features of each point p and its k nearest neighbours q (RRI).

    ``|p|`` about the cloud's mean; for each q ``|q|``, the angle between p and q, and the angle
    from q counter-clockwise about p to the next neighbour. Each kind is sorted by size, so two
    neighbours that are equally far may trade places. Of several equally far from p for the k-th
    place the one nearest to the mean is taken: neighbours are those of ``p / (1 + INWARD)``,
    which orders them by ``|p - q|^2 + INWARD |q|^2``. So neither the order of the points nor the
    pose decides.

    Raises:
        ValueError: The cloud has no more than ``k`` points.
    """
    centred = cloud - cloud.mean(dim=-2, keepdim=True)
    _, index = nearest(centred / (1 + INWARD), centred, k + 1)
    p, q = centred.unsqueeze(-2), gather_points(centred, index[..., 1:])  # the first is p itself
    kinds = q.norm(dim=-1), angle_between(p.expand_as(q), q), gaps_around(p, q)
    return torch.cat([p.norm(dim=-1), *(kind.sort(dim=-1).values for kind in kinds)], dim=-1)


def gaps_around(
    p: Float[Tensor, "batch n 1 3"], q: Float[Tensor, "batch n k 3"]
) -> Float[Tensor, "batch n k"]:
    """Angle from each q about p to the next, counter-clockwise; 2 pi in all, in any order."""
    axis = normalize(p, dim=-1)
    aside = one_hot(axis.abs().argmin(dim=-1), 3).to(axis)  # where angles start does not matter
    zero = normalize(torch.linalg.cross(axis, aside), dim=-1)
    ninety = torch.linalg.cross(axis, zero)
    azimuth = torch.atan2((q * ninety).sum(dim=-1), (q * zero).sum(dim=-1)).sort(dim=-1).values
    return torch.diff(azimuth, append=azimuth[..., :1] + 2 * math.pi)
