"""DeepGMR (Yuan et al. 2020): two clouds as Gaussian mixtures, aligned component by component."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from pcrdiff.geometry.neighbors import squared_distances
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import invert
from pcrdiff.models.invariants import describe_invariantly
from pcrdiff.models.mlp import he_layers, he_linear
from pcrdiff.registration import LearnedMethod, Losses, Pairs, Poses, Sources, Targets

LEAST_SHARE = 1e-6  # a component without points has no weight, and its mean does not matter
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
        self.neighbours, self.least_points = neighbours, neighbours + 1
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

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """How far both estimates, there and back, are from undoing the true pose."""
        source, target = self.mix(pairs.source), self.mix(pairs.target)
        T_truth = pairs.T_target_source.to(pairs.source)
        eye = torch.eye(4).to(T_truth).expand_as(T_truth)
        there, back = align(source, target), align(target, source)
        return {
            "there": mse_loss(there @ invert(T_truth), eye),
            "back": mse_loss(back @ T_truth, eye),
        }

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """One pass; nothing is drawn."""
        return align(self.mix(source), self.mix(target))


def align(source: Mixture, target: Mixture) -> Poses:
    """The pose under which the target's mixture explains the source's best (block M_T).

    A source component counts by its share, and the less the wider its counterpart is.
    """
    return fit_rigid(source.means, target.means, source.shares / target.variances)
