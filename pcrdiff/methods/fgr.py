"""Fast Global Registration (Zhou, Park & Koltun 2016) by Open3D."""

from dataclasses import dataclass

import numpy as np
import torch

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import (
    FeatureMatching,
    check_matches,
    cloud,
    registration,
    seed_open3d,
)
from pcrdiff.geometry.span import TOLERANCE
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class FGR(FeatureMatching, PairwiseMethod):
    """Matches FPFH features once, then fits a pose that forgives the wrong ones.

    Its distances are lengths in the clouds' own unit, not shares of their size.
    """

    name = "fgr"
    iterations: int

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Match and fit; the generator decides which matches are tested in triples."""
        seed_open3d(generator)
        p, q = cloud(source), cloud(target)
        option = registration.FastGlobalRegistrationOption(
            use_absolute_scale=True,
            maximum_correspondence_distance=self.max_distance,
            iteration_number=self.iterations,
        )
        result = registration.registration_fgr_based_on_feature_matching(
            p, q, self.fpfh(p), self.fpfh(q), option
        )
        pose = check_matches(self.name, p, q, result, self.max_distance)
        if (pose[:3, :3] == torch.eye(3)).all() and not _lies_on(p, q, result):
            raise ValueError(
                f"{self.name} needs features that agree on a pose, got none and the shift between "
                "the centroids"
            )
        return pose


def _lies_on(
    source: "open3d.geometry.PointCloud",
    target: "open3d.geometry.PointCloud",
    result: "open3d.pipelines.registration.RegistrationResult",
) -> bool:
    """Whether the answer lays the whole source on the target, up to rounding."""
    length = max(np.abs(np.asarray(each.points)).max() for each in (source, target))
    return bool(result.fitness == 1 and result.inlier_rmse <= TOLERANCE * length)
