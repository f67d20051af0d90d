"""Trimmed ICP (Chetverikov, Svirko, Stepanov & Krsek 2002), from the centroids' shift."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial import cKDTree
from torch import Tensor

from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import centroid_shift, transform
from pcrdiff.geometry.span import check_support
from pcrdiff.registration import PairwiseMethod, Pose, Source, Target

OVERLAPS = tuple(range(100, 39, -10))
"""Tried in turn, in percent; the paper searches 40 to 100 by golden section."""
PREFERENCE = 2.0
"""The paper's lambda: how much a larger overlap is worth."""
TOLERANCE = 1e-6
"""A round ends the search where it lowers the error by a smaller share."""


@dataclass(frozen=True)
class TrimmedICP(PairwiseMethod):
    """ICP that fits only the share of the points that lie nearest to the other cloud.

    The share that the clouds overlap is not known: it is the one with the least
    ``e(share) / share^(1 + lambda)`` (Eq. 4), e being the mean squared distance of the points
    that are kept. An answer whose own matches would not fix it is refused.
    """

    name = "trimmed_icp"
    max_iterations: int
    """Rounds for each share, fewer where the error stops falling."""

    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Refine the shift that lays the source's centroid on the target's."""
        T_start, p = centroid_shift(source, target), source.double()
        tree = cKDTree(target.double().numpy())
        best, T_best, kept = np.inf, T_start, 0
        for percent in OVERLAPS:
            keep = max(3, len(p) * percent // 100)
            error, T = self._trim(p, tree, T_start, keep)
            objective = error / (percent / 100) ** (1 + PREFERENCE)
            if objective < best:
                best, T_best, kept = objective, T, keep
        index, matches, _ = _nearest(p, tree, T_best, kept)
        check_support(self.name, p[index].numpy(), tree.data[matches], "among the nearest")
        return T_best

    def _trim(
        self, source: Float64[Tensor, "n 3"], tree: cKDTree, T: Pose, keep: int
    ) -> tuple[float, Pose]:
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
    source: Float64[Tensor, "n 3"], tree: cKDTree, T: Pose, keep: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index, match and distance of the ``keep`` points that ``T`` lays nearest to the target."""
    answer = tree.query(transform(T, source).numpy())
    distances, matches = np.asarray(answer[0]), np.asarray(answer[1])
    kept = np.argsort(distances, kind="stable")[:keep]
    return kept, matches[kept], distances[kept]
