"""Deep Closest Point (Wang & Solomon 2019), first version: DGCNN features and a soft pointer."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.models.dgcnn import DGCNN
from pcrdiff.models.losses import rotation_loss, translation_loss
from pcrdiff.models.matching import fit_pointers
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class DCPv1(LearnedMethod):
    """Features of every point of each cloud by itself, to soft matches, to the pose.

    The second version (``dcp_v2``) lets the clouds tell each other of themselves in between.
    """

    name = "dcp_v1"

    def __init__(self, feature_dim: int, neighbours: int) -> None:
        """``feature_dim`` of a point, 512 in DCP; ``neighbours`` on its graph, 20 in DCP."""
        super().__init__()
        self.encoder = DGCNN(feature_dim, neighbours)
        self.neighbours = neighbours

    def estimate(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> Float[Tensor, "batch 4 4"]:
        """T_target_source, in one pass (Secs. 4.1, 4.3 and 4.4)."""
        return fit_pointers(source, target, self.encoder(source), self.encoder(target))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Eq. (16); nothing is drawn."""
        del generator
        T_estimate = self.estimate(pairs.source, pairs.target)
        T_truth = pairs.T_target_source.to(T_estimate)
        return {
            "rotation": rotation_loss(T_estimate, T_truth),
            "translation": translation_loss(T_estimate, T_truth),
        }

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source; nothing is drawn."""
        del generator
        check_clouds(self.name, source, target, minimum=self.neighbours)
        return self.estimate(source, target)
