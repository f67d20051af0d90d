"""Feature-metric registration (Huang et al. 2020): PointNetLK with a feature that is decoded."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.models.losses import chamfer_loss
from pcrdiff.models.lucas_kanade import LucasKanadeMethod
from pcrdiff.models.mlp import he_layers
from pcrdiff.registration import Losses, Pairs


class FMR(LucasKanadeMethod):
    """Gauss-Newton on a feature from which the cloud, and so its pose, can be decoded."""

    name = "fmr"

    def __init__(
        self,
        feature_dim: int,
        decoded_points: int,
        difference: float,
        train_updates: int,
        updates: int,
    ) -> None:
        """As PointNetLK, with 10 updates after training and 2048 points by the authors.

        ``decoded_points`` is how many the decoder makes of a feature; the clouds may have others.
        """
        super().__init__(feature_dim, difference, train_updates, updates)
        self.decoder = nn.Sequential(
            *he_layers(feature_dim, (1024, 512, 256)),
            nn.Linear(256, 3 * decoded_points),
            nn.Tanh(),  # centred clouds of the unit sphere fill no larger cube
        )

    def decode(self, cloud: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch decoded 3"]:
        """The cloud as its feature alone describes it."""
        points: Tensor = self.decoder(self.encoder(cloud)).unflatten(-1, (-1, 3))
        return points

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """The semi-supervised one: both clouds decoded, and the pose after each update.

        Clouds are decoded about their own means, as they are aligned.
        """
        clouds = [
            cloud - cloud.mean(dim=-2, keepdim=True) for cloud in (pairs.source, pairs.target)
        ]
        decoded = [chamfer_loss(self.decode(cloud), cloud) for cloud in clouds]
        return {"decoded": torch.stack(decoded).sum(), "pose": self.align_loss(pairs)}
