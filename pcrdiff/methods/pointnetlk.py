"""PointNetLK (Aoki et al. 2019): Lucas-Kanade on the global feature of a PointNet."""

import torch

from pcrdiff.models.lucas_kanade import LucasKanadeMethod
from pcrdiff.registration import Losses, Pairs


class PointNetLK(LucasKanadeMethod):
    """Learns a feature on which Gauss-Newton finds the pose from far away.

    The authors make 20 updates after training.
    """

    name = "pointnetlk"

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """The error of the pose after each update.

        The authors' code adds ``|r|^2``, which a constant feature would minimise; the pose alone
        does not depend on how large the features are.
        """
        return {"pose": self.align_loss(pairs)}
