"""RANSAC's hypotheses (Fischler & Bolles 1981) on FPFH features, each refined and verified."""

import torch

from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.geometry.consistency import triple_poses
from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.registration import Source, Target


class RansacMultistart(VerifiedMethod):
    """Poses of random triples of matches; each is refined, and the best fit is the answer.

    RANSAC itself tries thousands of triples and refines the one that most matches support.
    """

    name = "ransac_multistart"

    def __init__(self, matching: FeatureMatching, starts: int, refinement: Refinement) -> None:
        """``starts`` is the number of triples."""
        self.matching, self.starts, self.refinement = matching, starts, refinement

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """The poses of random triples whose triangles are alike."""
        p, q = self.matching.match(source, target, mutual=True)
        return triple_poses(p, q, count, generator=generator)
