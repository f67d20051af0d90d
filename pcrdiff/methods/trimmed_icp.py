"""Trimmed ICP (Chetverikov, Svirko, Stepanov & Krsek 2002), from the centroids' shift."""

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree
from torch import Tensor

from pcrdiff.bindings.open3d_registration import centroid_shift, check_support
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import transform
from pcrdiff.registration import check_clouds

OVERLAPS = tuple(range(100, 39, -10))
"""Tried in turn, in percent; the paper searches 40 to 100 by golden section."""
PREFERENCE = 2.0
"""The paper's lambda: how much a larger overlap is worth."""
TOLERANCE = 1e-6
"""A round ends the search where it lowers the error by a smaller share."""


class TrimmedICP:
    """ICP that fits only the share of the points that lie nearest to the other cloud.

    The share that the clouds overlap is not known: it is the one with the least
    ``e(share) / share^(1 + lambda)`` (Eq. 4), e being the mean squared distance of the points
    that are kept.
    """

    name = "trimmed_icp"

    def __init__(self, max_iterations: int) -> None:
        """Rounds for each share, fewer where the error stops falling."""
        self.max_iterations = max_iterations

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Refine the shift that lays the source's centroid on the target's.

        Raises:
            ValueError: Also when the matches of the answer fix no pose.
        """
        del generator
        check_clouds(self.name, source, target)
        starts = torch.from_numpy(centroid_shift(source, target))
        trees = [cKDTree(cloud) for cloud in target.double().numpy()]
        clouds = zip(source.double(), trees, starts, strict=True)
        return torch.stack([self._register(p, tree, T) for p, tree, T in clouds])

    def _register(
        self,
        source: Float64[Tensor, "n 3"],
        tree: cKDTree,
        T_start: Float64[Tensor, "4 4"],
    ) -> Float64[Tensor, "4 4"]:
        best, T_best, kept = np.inf, T_start, 0
        for percent in OVERLAPS:
            keep = max(3, len(source) * percent // 100)
            error, T = self._trim(source, tree, T_start, keep)
            objective = error / (percent / 100) ** (1 + PREFERENCE)
            if objective < best:
                best, T_best, kept = objective, T, keep
        self._check(source, tree, T_best, kept)
        return T_best

    def _check(
        self, source: Float64[Tensor, "n 3"], tree: cKDTree, T: Float64[Tensor, "4 4"], keep: int
    ) -> None:
        """Refuse an answer whose own matches would not fix it."""
        kept, matches, _ = _nearest(source, tree, T, keep)
        check_support(self.name, source[kept].numpy(), tree.data[matches], "among the nearest")

    def _trim(
        self, source: Float64[Tensor, "n 3"], tree: cKDTree, T: Float64[Tensor, "4 4"], keep: int
    ) -> tuple[float, Float64[Tensor, "4 4"]]:
        """Mean squared distance of the ``keep`` nearest points, and the pose fitted to them."""
        target, before = torch.from_numpy(tree.data.copy()), np.inf
        for _ in range(self.max_iterations):
            kept, matches, distances = _nearest(source, tree, T, keep)
            error = float(np.square(distances).mean())
            if error >= before * (1 - TOLERANCE):
                break
            p, q = source[kept], target[matches]
            T, before = fit_rigid(p[None], q[None], torch.ones(1, keep).to(p))[0], error
        return before, T


def _nearest(
    source: Float64[Tensor, "n 3"], tree: cKDTree, T: Float64[Tensor, "4 4"], keep: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index of the ``keep`` points that ``T`` lays nearest to the target, their matches, how near."""
    answer = tree.query(transform(T, source).numpy())
    distances, matches = np.asarray(answer[0]), np.asarray(answer[1])
    kept = np.argsort(distances, kind="stable")[:keep]
    return kept, matches[kept], distances[kept]
