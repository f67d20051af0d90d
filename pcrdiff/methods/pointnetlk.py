"""PointNetLK (Aoki et al. 2019): Lucas-Kanade on the global feature of a PointNet."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.models.losses import pose_loss
from pcrdiff.models.lucas_kanade import align
from pcrdiff.models.pointnet import PointNet
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class PointNetLK(LearnedMethod):
    """Learns a feature on which Gauss-Newton from far away finds the pose."""

    name = "pointnetlk"

    def __init__(
        self, feature_dim: int, difference: float, train_updates: int, updates: int
    ) -> None:
        """The authors' numbers: a feature of 1024, 10 updates in training and 20 after it.

        ``difference`` of the Jacobian's finite differences: theirs is 0.01, 0.1 reaches further.
        """
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.difference, self.train_updates, self.updates = difference, train_updates, updates

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """``|G_est^-1 G_gt - I|_F`` after each update, mean over them (Aoki et al., Sec. 3).

        The authors' code adds ``|r|^2``, which a feature that tells nothing would lower best; the
        pose alone does not care how large the features are.
        """
        del generator
        poses = align(self.encoder, pairs.source, pairs.target, self.difference, self.train_updates)
        losses = [pose_loss(T_estimate, pairs.T_target_source) for T_estimate in poses]
        return {"pose": torch.stack(losses).mean().to(pairs.source)}

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Align until it converges or the updates are spent; nothing is drawn."""
        del generator
        check_clouds(self.name, source, target)
        return align(self.encoder, source, target, self.difference, self.updates)[-1].to(source)
