"""PCRNet (Sarode et al. 2019): global features of both clouds to a pose, again and again."""

from collections.abc import Mapping

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.geometry.representation import REPRESENTATIONS
from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.models.losses import nearest_distance
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.pose_head import PoseHead
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds

QUATERNION = REPRESENTATIONS["quaternion"]
FIRST_STEP = 0.1  # of a fresh network's step; repeated whole steps lead training far astray


class PCRNet(LearnedMethod):
    """Moves the source by what the network sees of both clouds, ``updates`` times."""

    name = "pcrnet"

    def __init__(self, feature_dim: int, train_updates: int, probes: int, updates: int) -> None:
        """The authors' numbers: a feature of 1024, 8 updates in training and after it.

        ``probes`` is how many points of each cloud, drawn anew, tell the loss how far it is to
        the other cloud; the authors ask all.
        """
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.head = PoseHead(2 * feature_dim, (1024, 1024, 512, 512, 256), QUATERNION.dim)
        with torch.no_grad():
            for parameter in self.head.layers[-1].parameters():
                parameter.mul_(FIRST_STEP)
        self.train_updates, self.probes, self.updates = train_updates, probes, updates

    def update(
        self,
        T: Float64[Tensor, "batch 4 4"],
        source: Float[Tensor, "batch n 3"],
        target_features: Float[Tensor, "batch dim"],
    ) -> Float64[Tensor, "batch 4 4"]:
        """``R <- R_i R, t <- R_i t + t_i`` for the step that the network takes from T."""
        moved = transform(T.to(source), source)
        step = self.head(torch.cat([self.encoder(moved), target_features], dim=-1)).double()
        return QUATERNION.decode(QUATERNION.identity.to(step) + step) @ T

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Distance between the clouds after each update; the true pose is not used.

        An update is trained from where the ones before it have led, not through them.
        """
        source, target = centre(pairs.source), centre(pairs.target)
        target_features = self.encoder(target)
        T = torch.eye(4, dtype=torch.float64, device=source.device).expand(len(source), 4, 4)
        terms = []
        for _ in range(self.train_updates):
            T = self.update(T.detach(), source, target_features)
            moved = transform(T.to(source), source)
            terms += [
                nearest_distance(draw(moved, self.probes, generator=generator), target),
                nearest_distance(draw(target, self.probes, generator=generator), moved),
            ]
        return {"distance": torch.stack(terms).mean()}

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Encode the target once and the source anew at each update; nothing is drawn."""
        del generator
        check_clouds(self.name, source, target)
        source_mean, target_mean = source.mean(dim=-2).double(), target.mean(dim=-2).double()
        target_features = self.encoder(centre(target))
        T = torch.eye(4, dtype=torch.float64, device=source.device).expand(len(source), 4, 4)
        for _ in range(self.updates):
            T = self.update(T, centre(source), target_features)
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
