"""From noise to a pose: what the methods that diffuse share, apart from their networks."""

from collections.abc import Callable, Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk, sample
from pcrdiff.geometry.neighbors import nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.pose_space import PoseSpace

TRUSTED = 0.5  # share of the points, the closest ones, that a fit is judged by


def walk_back(
    denoise: Callable[[Tensor, Tensor], Tensor],
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    space: PoseSpace,
    walk: Walk,
    *,
    generator: torch.Generator,
) -> Float[Tensor, "batch 4 4"]:
    """Walk from noise to a pose (Algorithm 2); of several walks, the one that fits best.

    No truth is needed to choose: see :func:`misfit`.
    """

    def follow(
        x_t: Float[Tensor, "batch dim"], t: Int[Tensor, " batch"]
    ) -> Float[Tensor, "batch dim"]:
        return denoise(x_t.to(source), t)

    found = sample(follow, len(source), space.dim, walk, generator=generator)
    return best_fit([space.decode(x_0) for x_0 in found], source, target)


def best_fit(
    poses: Sequence[Float[Tensor, "batch 4 4"]],
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
) -> Float[Tensor, "batch 4 4"]:
    """Of several answers to each pair the one with the least misfit; the first of equals."""
    if len(poses) == 1:
        return poses[0]
    misfits = torch.stack([misfit(transform(T, source), target) for T in poses])
    return torch.stack(list(poses))[misfits.argmin(dim=0), torch.arange(len(source))]


def misfit(
    moved: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
) -> Float[Tensor, " batch"]:
    """Mean distance to the nearest point of the other cloud, over the closest half of both.

    The further half is left out: it may be what the other cloud does not show.
    """
    ways = ((moved, target), (target, moved))
    squares = torch.cat([nearest(queries, points, 1)[0][..., 0] for queries, points in ways], dim=1)
    trusted = max(1, int(TRUSTED * squares.shape[1]))
    return squares.topk(trusted, dim=1, largest=False).values.sqrt().mean(dim=1)
