"""Feature-metric registration (Huang et al. 2020): PointNetLK with a feature that is decoded."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.models.losses import chamfer_loss, pose_loss
from pcrdiff.models.lucas_kanade import align
from pcrdiff.models.mlp import he_layers
from pcrdiff.models.pointnet import PointNet
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class FMR(LearnedMethod):
    """Gauss-Newton on a feature from which the cloud, and so its pose, can be read back."""

    name = "fmr"

    def __init__(
        self,
        feature_dim: int,
        decoded_points: int,
        difference: float,
        train_updates: int,
        updates: int,
    ) -> None:
        """The authors' numbers: a feature of 1024, 2048 points, 10 updates in training and after.

        ``decoded_points`` is how many the decoder makes of a feature; the clouds may have others.
        ``difference`` of the Jacobian's finite differences: theirs is 0.01, 0.1 reaches further.
        """
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.decoder = nn.Sequential(
            *he_layers(feature_dim, (1024, 512, 256)),
            nn.Linear(256, 3 * decoded_points),
            nn.Tanh(),  # centred clouds of the unit sphere fill no larger cube
        )
        self.difference, self.train_updates, self.updates = difference, train_updates, updates

    def decode(self, cloud: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch decoded 3"]:
        """What the cloud's feature alone tells of it."""
        points: Tensor = self.decoder(self.encoder(cloud)).unflatten(-1, (-1, 3))
        return points

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """The semi-supervised one: both clouds decoded, and the pose after each update.

        Clouds are decoded about their own means, as they are aligned.
        """
        del generator
        clouds = [
            cloud - cloud.mean(dim=-2, keepdim=True) for cloud in (pairs.source, pairs.target)
        ]
        decoded = [chamfer_loss(self.decode(cloud), cloud) for cloud in clouds]
        poses = align(self.encoder, pairs.source, pairs.target, self.difference, self.train_updates)
        losses = [pose_loss(T_estimate, pairs.T_target_source) for T_estimate in poses]
        return {
            "decoded": torch.stack(decoded).sum(),
            "pose": torch.stack(losses).mean().to(pairs.source),
        }

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Align until it converges or the updates are spent; the decoder has no part in it."""
        del generator
        check_clouds(self.name, source, target)
        return align(self.encoder, source, target, self.difference, self.updates)[-1].to(source)
