"""small_gicp's generalized ICP (Koide 2024), started from RANSAC on FPFH features."""

import numpy as np
import small_gicp
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.classical import ransac_fpfh
from pcrdiff.registration import check_clouds


class SmallGICP:
    """A global start, and a fine registration of surfaces behind it.

    The library's documented defaults: type GICP, one thread, surfaces from 10 neighbours, 20
    rounds, fewer once one turns by less than 0.1 degrees and moves by less than 0.001. Two of
    them are meant for scans in metres: its 1.0 between matched points is ``max_distance`` here,
    and its thinning to voxels of 0.25 is left out. The start is that of ``ransac_fpfh``: from
    the centroids alone GICP ends in a wrong basin on some shapes.
    """

    name = "small_gicp"

    def __init__(
        self,
        max_iterations: int,
        max_distance: float,
        feature_radius: float,
        feature_neighbours: int,
        normal_radius: float,
    ) -> None:
        """``max_distance`` holds for RANSAC's matches, too; all lengths in the clouds' unit."""
        self.max_iterations, self.max_distance = max_iterations, max_distance
        self.feature = (feature_radius, feature_neighbours, normal_radius)

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Start globally and refine; the generator decides which matches the start tries."""
        check_clouds(self.name, source, target)
        poses = [self._register(p, q, generator) for p, q in zip(source, target, strict=True)]
        return torch.from_numpy(np.stack(poses))

    def _register(
        self, source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"], generator: torch.Generator
    ) -> Float64[np.ndarray, "4 4"]:
        start = ransac_fpfh(source, target, self.max_distance, self.feature, generator=generator)
        p, q = surface(source), surface(target)
        result = small_gicp.align(
            q,
            p,
            init_T_target_source=start,
            registration_type="GICP",
            max_correspondence_distance=self.max_distance,
            max_iterations=self.max_iterations,
            num_threads=1,
        )
        pose: Float64[np.ndarray, "4 4"] = np.array(result.T_target_source)
        return pose


def surface(points: Float[Tensor, "n 3"]) -> "small_gicp.PointCloud":
    """A cloud of the library's, each point with the spread of its 10 nearest."""
    cloud = small_gicp.PointCloud(points.double().numpy())
    small_gicp.estimate_covariances(cloud, num_neighbors=10)
    return cloud
