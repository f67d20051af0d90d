"""Features of a point and its neighbours that no rotation changes (Yuan et al. 2020, DeepGMR)."""

import math

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize, one_hot

from pcrdiff.geometry.neighbors import gather_points, nearest
from pcrdiff.geometry.rotation import angle_between

INWARD = 1e-3  # how a tie between neighbours is decided, see `describe_invariantly`


@torch.no_grad()
def describe_invariantly(
    cloud: Float[Tensor, "batch n 3"], k: int
) -> Float[Tensor, "batch n 3*{k}+1"]:
    """Rotation-invariant features of each point p and its k nearest neighbours q (RRI).

    ``|p|`` about the cloud's mean; for each q ``|q|``, the angle between p and q, and the angle
    from q counter-clockwise about p to the next neighbour. Each kind is sorted by size, so two
    neighbours that are equally far may trade places. Of several equally far from p for the k-th
    place the one nearest to the mean is taken: neighbours are those of ``p / (1 + INWARD)``,
    which orders them by ``|p - q|^2 + INWARD |q|^2``. So neither the order of the points nor the
    pose decides.

    Raises:
        ValueError: The cloud has no more than ``k`` points.
    """
    centred = cloud - cloud.mean(dim=-2, keepdim=True)
    _, index = nearest(centred / (1 + INWARD), centred, k + 1)
    p, q = centred.unsqueeze(-2), gather_points(centred, index[..., 1:])  # the first is p itself
    kinds = q.norm(dim=-1), angle_between(p.expand_as(q), q), gaps_around(p, q)
    return torch.cat([p.norm(dim=-1), *(kind.sort(dim=-1).values for kind in kinds)], dim=-1)


def gaps_around(
    p: Float[Tensor, "batch n 1 3"], q: Float[Tensor, "batch n k 3"]
) -> Float[Tensor, "batch n k"]:
    """Angle from each q about p to the next, counter-clockwise; 2 pi in all, in any order."""
    axis = normalize(p, dim=-1)
    aside = one_hot(axis.abs().argmin(dim=-1), 3).to(axis)  # where angles start does not matter
    zero = normalize(torch.linalg.cross(axis, aside), dim=-1)
    ninety = torch.linalg.cross(axis, zero)
    azimuth = torch.atan2((q * ninety).sum(dim=-1), (q * zero).sum(dim=-1)).sort(dim=-1).values
    return torch.diff(azimuth, append=azimuth[..., :1] + 2 * math.pi)
