"""SC2-PCR (Chen et al. 2022) on FPFH features, refined and verified."""

import torch

from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.geometry.consistency import consistent_poses
from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.registration import Source, Target


class SC2PCR(VerifiedMethod):
    """Poses of matches that agree to second order; each is refined, and the best fit is the answer.

    The paper answers with the pose that most matches support, and refines that one only.
    """

    name = "sc2_pcr"

    def __init__(self, matching: FeatureMatching, starts: int, refinement: Refinement) -> None:
        """``starts`` is the greatest number of poses that are refined."""
        self.matching, self.starts, self.refinement = matching, starts, refinement

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """The best supported poses of the nearest features' matches; nothing is drawn."""
        del generator
        p, q = self.matching.match(source, target)
        return consistent_poses(p, q, self.matching.max_distance)[:count]
