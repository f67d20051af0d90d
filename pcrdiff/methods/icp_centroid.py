"""The third floor of every table: ICP started from the shift between the centroids."""

from dataclasses import dataclass

import torch

from pcrdiff.bindings.open3d_registration import PointToPoint
from pcrdiff.geometry.rigid import centroid_shift
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class ICPCentroid(PointToPoint, PairwiseMethod):
    """Point-to-point ICP that is spared the translation; solves full overlap on its own."""

    name = "icp_centroid"

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Refine the shift that lays the source's centroid on the target's."""
        return self.refine(self.name, source, target, centroid_shift(source, target))
