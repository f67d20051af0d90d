"""PCRNet (Sarode et al. 2019): global features of both clouds to a pose, again and again."""

from collections.abc import Iterator

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.geometry.representation import REPRESENTATIONS
from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.models.losses import nearest_distance
from pcrdiff.models.mlp import PoseHead
from pcrdiff.models.pointnet import PointNet
from pcrdiff.registration import LearnedMethod, Losses, Pairs, Poses, Sources, Targets

QUATERNION = REPRESENTATIONS["quaternion"]
FIRST_STEP = 0.1  # of a fresh network's step; repeated whole steps lead training far astray


class PCRNet(LearnedMethod):
    """Moves the source by what the network reads from both clouds, ``updates`` times."""

    name = "pcrnet"

    def __init__(self, feature_dim: int, train_updates: int, probes: int, updates: int) -> None:
        """The authors' numbers: a feature of 1024, 8 updates in training and after it.

        ``probes`` is the number of points of each cloud, drawn again for each term, whose
        distance to the other cloud the loss takes; the authors take all.
        """
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.head = PoseHead(2 * feature_dim, (1024, 1024, 512, 512, 256), QUATERNION.dim)
        with torch.no_grad():
            for parameter in self.head.layers[-1].parameters():
                parameter.mul_(FIRST_STEP)
        self.train_updates, self.probes, self.updates = train_updates, probes, updates

    def update(
        self, T: Float64[Tensor, "batch 4 4"], source: Sources, features: Float[Tensor, "batch dim"]
    ) -> Float64[Tensor, "batch 4 4"]:
        """``R <- R_i R, t <- R_i t + t_i`` for the step from T, given the target's features."""
        moved = transform(T.to(source), source)
        step = self.head(torch.cat([self.encoder(moved), features], dim=-1)).double()
        return QUATERNION.decode(QUATERNION.identity.to(step) + step) @ T

    def align(
        self, source: Sources, target: Targets, updates: int
    ) -> Iterator[Float64[Tensor, "batch 4 4"]]:
        """T_target_source after each update of clouds about their own means.

        The target is encoded once, the source again at each update. An update passes no gradient
        to the next one.
        """
        features = self.encoder(target)
        T = torch.eye(4, dtype=torch.float64, device=source.device).expand(len(source), 4, 4)
        for _ in range(updates):
            T = self.update(T.detach(), source, features)
            yield T

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Distance between the clouds after each update; the true pose is not used."""
        source, target = centre(pairs.source), centre(pairs.target)
        terms = []
        for T in self.align(source, target, self.train_updates):
            moved = transform(T.to(source), source)
            terms += [
                nearest_distance(draw(moved, self.probes, generator=generator), target),
                nearest_distance(draw(target, self.probes, generator=generator), moved),
            ]
        return {"distance": torch.stack(terms).mean()}

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """The pose after the last update; nothing is drawn."""
        source_mean, target_mean = source.mean(dim=-2).double(), target.mean(dim=-2).double()
        *_, T = self.align(centre(source), centre(target), self.updates)
        R, t = T[:, :3, :3], T[:, :3, 3]
        turned_mean = (R @ source_mean.unsqueeze(-1)).squeeze(-1)
        return from_parts(R, t + target_mean - turned_mean).to(source)


def centre(cloud: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch n 3"]:
    """The cloud about its own mean."""
    return cloud - cloud.mean(dim=-2, keepdim=True)


def draw(
    cloud: Float[Tensor, "batch n 3"], count: int, *, generator: torch.Generator
) -> Float[Tensor, "batch chosen 3"]:
    """``count`` points without repetition, or all there are."""
    return cloud[:, torch.randperm(cloud.shape[1], generator=generator)[:count]]
