"""small_gicp's generalized ICP (Koide 2024), started from RANSAC on FPFH features."""

import numpy as np
import small_gicp
import torch
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree
from torch import Tensor

from pcrdiff.bindings.open3d_registration import check_pose, check_support, ransac_fpfh
from pcrdiff.geometry.rigid import transform
from pcrdiff.geometry.span import TOLERANCE
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
        reach = self.max_distance
        start = ransac_fpfh(self.name, source, target, reach, self.feature, generator=generator)
        p, q = surface(source), surface(target)
        result = small_gicp.align(
            q,
            p,
            init_T_target_source=start,
            registration_type="GICP",
            max_correspondence_distance=reach,
            max_iterations=self.max_iterations,
            num_threads=1,
        )
        pose = np.array(result.T_target_source)
        moved = result.converged or (pose != start).any()
        if not (moved or _lies_on(source, target, start)):
            raise ValueError(f"{self.name} needs a step that brings the clouds nearer, found none")
        check_support(self.name, *_matches(source, target, pose, reach), f"within {reach}")
        return check_pose(self.name, pose)


def _lies_on(
    source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"], pose: Float64[np.ndarray, "4 4"]
) -> bool:
    """Whether the pose lays the whole source on the target, so that no step can better it."""
    length = float(max(source.abs().max(), target.abs().max()))
    return len(_matches(source, target, pose, TOLERANCE * length)[0]) == len(source)


def _matches(
    source: Float[Tensor, "n 3"],
    target: Float[Tensor, "m 3"],
    pose: Float64[np.ndarray, "4 4"],
    reach: float,
) -> tuple[Float64[np.ndarray, "matches 3"], Float64[np.ndarray, "matches 3"]]:
    """The points that the pose lays within reach of the target, and those nearest to them."""
    p, q = source.double(), target.double().numpy()
    distances, nearest = cKDTree(q).query(transform(torch.from_numpy(pose), p).numpy())
    near = np.asarray(distances) <= reach
    return p.numpy()[near], q[np.asarray(nearest)[near]]


def surface(points: Float[Tensor, "n 3"]) -> "small_gicp.PointCloud":
    """A cloud of the library's, each point with the spread of its 10 nearest."""
    cloud = small_gicp.PointCloud(points.double().numpy())
    small_gicp.estimate_covariances(cloud, num_neighbors=10)
    return cloud
