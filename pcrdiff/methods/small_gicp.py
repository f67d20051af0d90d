"""small_gicp's generalized ICP (Koide 2024), started from RANSAC on FPFH features."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial import cKDTree

from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.bindings.small_gicp import Surface, align
from pcrdiff.geometry.rigid import check_pose, transform
from pcrdiff.geometry.span import TOLERANCE, check_support
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target


@dataclass(frozen=True)
class SmallGICP(FeatureMatching, PairwiseMethod):
    """A global start, and a fine registration of surfaces behind it.

    The library's documented defaults: type GICP, one thread, surfaces from 10 neighbours, 20
    rounds, fewer once one turns by less than 0.1 degrees and moves by less than 0.001. Two of
    them are meant for scans in metres: its 1.0 between matched points is ``max_distance`` here,
    and its thinning to voxels of 0.25 is left out. The start is that of ``ransac_fpfh``: from
    the centroids alone GICP ends in a wrong basin on some shapes.
    """

    name = "small_gicp"
    max_iterations: int

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Start globally and refine; the generator decides which matches the start tries."""
        start = self.ransac(self.name, source, target, generator=generator)
        p, q = Surface(source.double().numpy()), Surface(target.double().numpy())
        result = align(p, q, start.numpy(), "GICP", self.max_distance, self.max_iterations)
        T = torch.from_numpy(np.array(result.T_target_source))
        moved = result.converged or (start != T).any()
        if not (moved or _lies_on(source, target, start)):
            raise ValueError(f"{self.name} needs a step that brings the clouds nearer, found none")
        matches = _matches(source, target, T, self.max_distance)
        check_support(self.name, *matches, f"within {self.max_distance}")
        return check_pose(self.name, T.numpy())


def _lies_on(source: Source, target: Target, T: Pose) -> bool:
    """Whether the pose lays the whole source on the target, so that no step can better it."""
    length = float(max(source.abs().max(), target.abs().max()))
    return len(_matches(source, target, T, TOLERANCE * length)[0]) == len(source)


def _matches(
    source: Source, target: Target, T: Pose, reach: float
) -> tuple[Float64[np.ndarray, "matches 3"], Float64[np.ndarray, "matches 3"]]:
    """The points that the pose lays within reach of the target, and those nearest to them."""
    p, q = source.double(), target.double().numpy()
    distances, nearest = cKDTree(q).query(transform(T, p).numpy())
    near = np.asarray(distances) <= reach
    return p.numpy()[near], q[np.asarray(nearest)[near]]
