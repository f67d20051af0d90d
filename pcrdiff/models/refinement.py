"""RPM-Net's loop (Yew & Lee 2020): match, fit a pose, move the source by it, and again."""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.models.matching import fit_matches

SINKHORN_ITERATIONS = 5  # RPM-Net's

Steps = list[tuple[Float[Tensor, "batch 4 4"], Float[Tensor, "batch n m"]]]
"""The pose and the matches it was fitted to, of each update."""

Matcher = Callable[
    [Float[Tensor, "batch 4 4"], Float[Tensor, "batch n 3"], Float[Tensor, "batch m 3"]],
    Float[Tensor, "batch n m"],
]
"""The pose so far, the source under it and the target, to matches; all from the target's mean."""


def refine(
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    match: Matcher,
    updates: int,
) -> Steps:
    """T_target_source and the matches after each update.

    The first update sees the clouds with their means in one place. Each pose is fitted to the
    source as it was given, and passes no gradient to the next update.

    Raises:
        ValueError: ``updates`` is not at least 1.
    """
    if updates < 1:
        raise ValueError(f"refine needs at least 1 update, got {updates}")
    p_mean, q_mean = source.mean(dim=-2), target.mean(dim=-2)
    p, q = source - p_mean.unsqueeze(-2), target - q_mean.unsqueeze(-2)
    eye = torch.eye(3).to(source).expand(len(source), 3, 3)
    T, steps = from_parts(eye, torch.zeros_like(p_mean)), []
    for _ in range(updates):
        matches = match(T, transform(T, p), q)
        estimate = fit_matches(p, q, matches)
        steps.append((from_parts(eye, q_mean) @ estimate @ from_parts(eye, -p_mean), matches))
        T = estimate.detach()
    return steps
