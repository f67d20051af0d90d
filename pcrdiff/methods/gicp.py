"""Generalized ICP (Segal, Haehnel & Thrun 2009) by Open3D, from the centroids' shift."""

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.bindings.open3d_registration import (
    centred,
    check_matches,
    cloud,
    one_thread,
    registration,
)
from pcrdiff.geometry.rigid import invert
from pcrdiff.registration import check_clouds


class GICP:
    """ICP in which a point may slide along its own surface and that of its match.

    Open3D's documented settings: surfaces from 20 neighbours with 0.001 of their spread across,
    30 rounds, fewer where one changes fitness and RMSE by less than 1e-6. Its distance between
    matched points has no default. It turns clouds about the origin, and far from it does not
    converge: both are laid there first.
    """

    name = "gicp"

    def __init__(self, max_iterations: int, max_distance: float) -> None:
        """``max_distance`` between matched points, in the clouds' unit."""
        self.max_iterations, self.max_distance = max_iterations, max_distance

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Refine the shift that lays the source's centroid on the target's."""
        del generator
        check_clouds(self.name, source, target)
        return torch.stack([self._register(p, q) for p, q in zip(source, target, strict=True)])

    def _register(
        self, source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"]
    ) -> Float64[Tensor, "4 4"]:
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
        pose = check_matches(self.name, p_cloud, q_cloud, result, self.max_distance)
        T_q_p = torch.from_numpy(pose)
        return T_target_q @ T_q_p @ invert(T_source_p)
