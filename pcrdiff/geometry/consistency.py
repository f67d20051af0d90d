"""Poses from matches of which many are wrong: the right ones keep the lengths between them."""

import math

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import transform

Matched = Float[Tensor, "matches 3"]
"""Points of one cloud, row by row the matches of the other's."""
Grown = Float[Tensor, "matches 4 4"]
"""A pose that grew from each match."""
Poses = Float[Tensor, "poses 4 4"]
GROUP = 20
"""Matches that a pose is fitted to: those that agree best with the one it grows from."""
ALIKE = math.cos(math.radians(10.0))
"""Cosine of the angle within which two poses are alike if they also shift points alike."""
LENGTH_RATIO = 0.9
"""Of the edges of two triangles that are alike, the shorter to the longer, at least."""
TRIALS = 64
"""Triples that are tried for each one that is wanted."""


def consistent_poses(source: Matched, target: Matched, tolerance: float) -> Poses:
    """The poses of groups of matches that agree with each other, the best supported first.

    Second-order spatial compatibility, SC2-PCR (Chen et al. 2022): two matches are compatible if
    they keep the length between their points, and compatible matches agree the better the more
    others are compatible with both (Eq. 4). That tells right matches from matches that are
    compatible by chance. Every match is the seed of a group; the paper selects some.

    Args:
        source: Points in the source frame.
        target: Their matches in the target frame.
        tolerance: By how much lengths may differ, and how far a match may lie off a pose that it
            supports, in the clouds' unit.

    Returns:
        T_target_source, none within 10 degrees and two tolerances of a better supported one.
    """
    lengths = torch.cdist(source, source) - torch.cdist(target, target)
    compatible = (lengths.abs() <= tolerance).to(source)  # with itself, too
    agreement = compatible * (compatible @ compatible)
    weights, group = agreement.topk(min(GROUP, len(source)), dim=1)
    T = fit_rigid(source[group], target[group], weights)
    T = T[_support(T, source, target, tolerance).argsort(descending=True, stable=True)]
    return _without_alike(T, 2 * tolerance)


def _support(
    T: Grown, source: Matched, target: Matched, tolerance: float
) -> Int[Tensor, " matches"]:
    """How many matches each pose lays on each other."""
    off = (transform(T, source.expand(len(T), -1, -1)) - target).norm(dim=-1)
    count: Tensor = (off <= tolerance).sum(dim=-1)
    return count


def _without_alike(T: Grown, shift: float) -> Poses:
    """The poses that are not alike to one before them."""
    R, t = T[:, :3, :3].flatten(1), T[:, :3, 3]
    alike = ((R @ R.T - 1) / 2 >= ALIKE) & (torch.cdist(t, t) <= shift)
    kept = list[int]()
    for k in range(len(T)):
        if not alike[k, kept].any():
            kept.append(k)
    return T[kept]


def triple_poses(
    source: Matched, target: Matched, count: int, *, generator: torch.Generator
) -> Poses:
    """The poses of ``count`` random triples of matches: the hypotheses of RANSAC.

    Fischler & Bolles (1981), with Open3D's check: the triangles of a triple's points in both
    clouds have edges of about the same lengths. Where too few of the triples tried pass it, those
    that come nearest to it are taken.
    """
    triples = torch.randint(len(source), (TRIALS * count, 3), generator=generator)
    p, q = source[triples], target[triples]
    edges = [(corners - corners.roll(1, dims=1)).norm(dim=-1) for corners in (p, q)]
    longest = torch.maximum(*edges).clamp(min=torch.finfo(p.dtype).tiny)
    ratio = (torch.minimum(*edges) / longest).amin(dim=1)  # 0 if a match was drawn twice
    best = ratio.clamp(max=LENGTH_RATIO).argsort(descending=True, stable=True)[:count]
    return fit_rigid(p[best], q[best], torch.ones(p[best].shape[:2]).to(p))
