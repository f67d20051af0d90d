"""RANSAC on FPFH features (Fischler & Bolles 1981; Rusu et al. 2009) by Open3D."""

from dataclasses import dataclass

import torch

from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class RansacFPFH(FeatureMatching, PairwiseMethod):
    """Matches FPFH features once and keeps the pose of three matches that most others support.

    Open3D's documented settings, see :class:`FeatureMatching`; the distances that its examples
    measure in voxels are lengths here, and clouds are not thinned to voxels.
    """

    name = "ransac_fpfh"

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Match and fit; the generator decides which matches are tried."""
        return self.ransac(self.name, source, target, generator=generator)
