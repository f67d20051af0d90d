"""Generate, refine, verify: of many start poses the one under which two clouds fit best.

Starts come from anywhere: random rotations, matched features, samples of a diffused pose. What a
source of starts is worth is how few of them lead to the right answer.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from torch import Tensor

from pcrdiff.bindings.small_gicp import Points, Pose, Surface, align
from pcrdiff.geometry.metrics import RIGHT_DEG, RIGHT_T
from pcrdiff.geometry.rigid import check_pose
from pcrdiff.geometry.span import check_support
from pcrdiff.registration import EVIDENCE, PairwiseMethod, Source, Target

Distances = Float64[np.ndarray, "_"]
Starts = Float[Tensor, "starts 4 4"]
ROUNDS = 15
"""Most rounds of ICP at each distance."""
SAME_TURN, SAME_SHIFT = float(np.cos(np.radians(RIGHT_DEG))), RIGHT_T
"""Within which two poses are one answer: the cosine of 5 degrees, a tenth of the cloud's radius."""
AWAY_TURN, AWAY_SHIFT = float(np.radians(10.0)), RIGHT_T
"""How far from an answer the fit has to be worse: what moves points about as far as each other."""
CLOSE = 1 / 3
"""Share of the truncation within which points are close: as near as copies of each other."""


@dataclass(frozen=True)
class Refinement:
    """How starts are refined and judged; lengths in the clouds' unit."""

    distances: tuple[float, ...]
    """Largest distance between matched points of generalized ICP, one after the other."""
    polish: float
    """The same of point-to-point ICP behind it, which is kept where it fits better."""
    truncation: float
    """A point further from the other cloud counts as this far: it may have no counterpart."""
    coarse_points: int
    """Of each cloud, on which all starts are refined and judged."""
    finalists: int
    """How many of the best are then refined on all points."""


@dataclass(frozen=True)
class Verified:
    """An answer, and what speaks for it; all but the pose are shares."""

    T_target_source: Float64[Tensor, "4 4"]
    residual: float
    """Mean truncated distance to the other cloud over both clouds' points, of the truncation."""
    overlap: float
    """Share of both clouds' points that lie within the truncation of the other cloud."""
    agreement: float
    """Share of the starts that led to this answer."""
    margin: float
    """By how much the best other answer fits worse, of the truncation; 1 where there is none."""
    close: float
    """Share of both clouds' points that lie within a third of the truncation of the other cloud."""
    sharpness: float
    """By how much the fit is worse a tenth of the radius or 10 degrees away, of the truncation.

    Of the ways along and about the target's principal axes the one that costs least: a pose that
    slides or turns without the fit being worse is not determined.
    """

    @property
    def evidence(self) -> Float64[np.ndarray, " numbers"]:
        """What speaks for the answer, as ``EVIDENCE`` names it."""
        return np.array([getattr(self, name) for name in EVIDENCE])


class VerifiedMethod(PairwiseMethod):
    """A method that proposes starts, refines them, and answers with the one that fits best."""

    starts: int
    refinement: Refinement

    @abstractmethod
    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """At most ``count`` start poses T_target_source, the most promising first if it knows."""

    def verify(self, source: Source, target: Target, *, generator: torch.Generator) -> Verified:
        """The answer to one pair, and what speaks for it; without a gradient.

        Raises:
            ValueError, RuntimeError: As ``register`` does.
        """
        with self.checked(source.unsqueeze(0), target.unsqueeze(0)):
            return self.judge(source, target, generator=generator)

    def judge(self, source: Source, target: Target, *, generator: torch.Generator) -> Verified:
        """What :meth:`verify` returns for clouds that have passed its checks.

        Raises:
            ValueError: The answer is no rigid pose.
        """
        starts = self.propose(source, target, self.starts, generator=generator)
        return Search(starts, source, target, self.refinement).judge(self.name, len(starts))

    def answer_pair(
        self, source: Source, target: Target, *, generator: torch.Generator
    ) -> Float64[Tensor, "4 4"]:
        """The answer alone."""
        return self.judge(source, target, generator=generator).T_target_source


@dataclass(frozen=True)
class Fit:
    """A pose and how well it lays one cloud on the other; see :class:`Verified`."""

    T: Pose
    residual: float
    overlap: float


class Verifier:
    """Two clouds, ready to be laid on each other again and again."""

    def __init__(self, source: Points, target: Float64[np.ndarray, "m 3"], how: Refinement) -> None:
        self.source, self.target, self.how = Surface(source), Surface(target), how
        self.trees = cKDTree(source), cKDTree(target)

    def align(self, T: Pose, *distances: float) -> Pose:
        """Generalized ICP (Segal, Haehnel & Thrun 2009) at one distance after the other."""
        for distance in distances:
            result = align(self.source, self.target, T, "GICP", distance, ROUNDS)
            T = np.array(result.T_target_source)
        return T

    def polish(self, T: Pose) -> Pose:
        """Point-to-point ICP: finer where both clouds hold samples of the same points."""
        result = align(self.source, self.target, T, "ICP", self.how.polish, ROUNDS)
        return np.array(result.T_target_source)

    def distances(self, T: Pose) -> tuple[Distances, Distances]:
        """From each point of source and target to the other cloud, infinite beyond the truncation."""
        (p_tree, q_tree), (R, t), most = self.trees, (T[:3, :3], T[:3, 3]), self.how.truncation
        of_source, _ = q_tree.query(self.source.points @ R.T + t, distance_upper_bound=most)
        of_target, _ = p_tree.query((self.target.points - t) @ R, distance_upper_bound=most)
        return np.asarray(of_source), np.asarray(of_target)

    def fit(self, T: Pose) -> Fit:
        """How near each cloud lies to the other one."""
        shares = np.concatenate(self.distances(T)) / self.how.truncation
        return Fit(T, float(np.minimum(shares, 1).mean()), float((shares < 1).mean()))

    def close(self, T: Pose) -> float:
        """The share of both clouds' points that lie close to the other cloud."""
        return float((np.concatenate(self.distances(T)) < CLOSE * self.how.truncation).mean())

    def sharpness(self, best: Fit) -> float:
        """By how much the fit is worse away from ``best``; the clouds lie about the origin."""
        _, _, axes = np.linalg.svd(self.target.points, full_matrices=False)
        away = [self.fit(move @ best.T).residual for axis in axes for move in _moves(axis)]
        return min(away) - best.residual

    def check(self, who: str, T: Pose) -> None:
        """Refuse a pose that the points near the other cloud do not fix.

        Raises:
            ValueError: In one of the clouds they are fewer than three, or on a line.
        """
        clouds = self.source.points, self.target.points
        for points, distances in zip(clouds, self.distances(T), strict=True):
            near = points[np.isfinite(distances)]
            check_support(who, near, near, f"within {self.how.truncation}")


class Search:
    """Starts of one pair, refined on few points of each cloud and ready to be judged."""

    def __init__(self, starts: Starts, source: Source, target: Target, how: Refinement) -> None:
        """Refine every start."""
        p, q = source.double().numpy(), target.double().numpy()
        self.T_source_p, self.T_target_q = _shift(p.mean(axis=0)), _shift(q.mean(axis=0))
        p, q = p - p.mean(axis=0), q - q.mean(axis=0)
        coarse = Verifier(_thin(p, how.coarse_points), _thin(q, how.coarse_points), how)
        T_q_target = np.linalg.inv(self.T_target_q)
        about_centroids = [T_q_target @ T @ self.T_source_p for T in starts.double().numpy()]
        self.fits = [coarse.fit(coarse.align(T, *how.distances)) for T in about_centroids]
        self.fine = Verifier(p, q, how)

    def judge(self, who: str, count: int) -> Verified:
        """Answer with the pose under which the clouds fit best, of the first ``count`` starts.

        The best of them, as long as they differ, are refined on all points. The true pose is not
        used.

        Raises:
            ValueError: The answer, which ``who`` names, is no rigid pose, or the points that the
                clouds share do not fix it.
        """
        fits = self.fits[:count]
        finished = [_finish(self.fine, fit.T) for fit in _distinct(fits)[: self.fine.how.finalists]]
        best = min(finished, key=lambda fit: fit.residual)
        self.fine.check(who, best.T)
        others = [fit.residual for fit in _distinct(finished) if not _same(fit.T, best.T)]
        return Verified(
            check_pose(who, self.T_target_q @ best.T @ np.linalg.inv(self.T_source_p)),
            best.residual,
            best.overlap,
            agreement=float(np.mean([_same(fit.T, best.T) for fit in fits])),
            margin=min(others) - best.residual if others else 1.0,
            close=self.fine.close(best.T),
            sharpness=self.fine.sharpness(best),
        )


def _finish(fine: Verifier, T: Pose) -> Fit:
    """The pose refined on all points, with or without the polish: whichever fits better."""
    T = fine.align(T, fine.how.distances[-1])
    return min((fine.fit(T), fine.fit(fine.polish(T))), key=lambda fit: fit.residual)


def _thin(points: Points, count: int) -> Float64[np.ndarray, "about_count 3"]:
    """Every n-th point, so that about ``count`` are left."""
    return points[:: max(1, round(len(points) / count))]


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """The best fit of each answer, the best answer first."""
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.residual):
        if not any(_same(fit.T, other.T) for other in kept):
            kept.append(fit)
    return kept


def _same(a: Pose, b: Pose) -> bool:
    turn, shift = (np.sum(a[:3, :3] * b[:3, :3]) - 1) / 2, np.linalg.norm(a[:3, 3] - b[:3, 3])
    return bool(turn >= SAME_TURN and shift <= SAME_SHIFT)


def _moves(axis: Float64[np.ndarray, "3"]) -> list[Pose]:
    """Both ways along an axis through the origin, and both ways about it."""
    moves = [_shift(way * AWAY_SHIFT * axis) for way in (-1, 1)]
    for way in (-1, 1):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_rotvec(way * AWAY_TURN * axis).as_matrix()
        moves.append(T)
    return moves


def _shift(by: Float64[np.ndarray, "3"]) -> Pose:
    T = np.eye(4)
    T[:3, 3] = by
    return T
