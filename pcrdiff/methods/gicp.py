"""Generalized ICP (Segal, Haehnel & Thrun 2009) by Open3D, from the centroids' shift."""

from dataclasses import dataclass

import numpy as np
import torch

from pcrdiff.bindings.open3d_registration import check_matches, cloud, one_thread, registration
from pcrdiff.geometry.rigid import centred, invert
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class GICP(PairwiseMethod):
    """ICP in which a point may slide along its own surface and that of its match.

    Open3D's documented settings: surfaces from 20 neighbours with 0.001 of their spread across,
    30 rounds, fewer where one changes fitness and RMSE by less than 1e-6. Its distance between
    matched points has no default. It turns clouds about the origin and does not converge far
    from it, so both clouds are moved there first.
    """

    name = "gicp"
    max_iterations: int
    max_distance: float
    """Between matched points, in the clouds' unit."""

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Refine the shift that lays the source's centroid on the target's."""
        (p, T_source_p), (q, T_target_q) = centred(source), centred(target)
        p_cloud, q_cloud = cloud(p), cloud(q)
        with one_thread():
            result = registration.registration_generalized_icp(
                p_cloud,
                q_cloud,
                self.max_distance,
                np.eye(4),
                registration.TransformationEstimationForGeneralizedICP(epsilon=0.001),
                registration.ICPConvergenceCriteria(max_iteration=self.max_iterations),
            )
        if len(result.correspondence_set) == 0:
            raise ValueError(
                f"{self.name} needs points within {self.max_distance} of each other where it "
                "ends, got none"
            )
        T_q_p = check_matches(self.name, p_cloud, q_cloud, result, self.max_distance)
        return T_target_q @ T_q_p @ invert(T_source_p)
