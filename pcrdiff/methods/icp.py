"""Point-to-point ICP (Besl & McKay 1992) by Open3D, started from where the clouds are."""

from dataclasses import dataclass

import torch

from pcrdiff.bindings.open3d_registration import PointToPoint
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class ICP(PointToPoint, PairwiseMethod):
    """Every point goes to its nearest neighbour, again and again."""

    name = "icp"

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Refine the identity."""
        return self.refine(self.name, source, target, torch.eye(4, dtype=torch.float64))
