"""Descriptors of each point's neighbourhood (EGST's, RPM-Net's), and their embedding."""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcrdiff.geometry.neighbors import estimate_normals, gather_points, nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.geometry.rotation import angle_between
from pcrdiff.models.edge_mlp import pool_edges

DESCRIPTOR_DIM, PAIR_DIM = 11, 10  # of EGST, of RPM-Net

TRIPLETS = 1 << 19
"""Whose cosines are held at once: 2 MiB in float32. With fewer, calls cost more than sums."""


def neighbourhoods(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"] | None,
    radius: float,
    k: int,
) -> tuple[Float[Tensor, "batch n k 10"], Int[Tensor, "batch n k"]]:
    """Numbers of each point and its neighbours, and the neighbours' index.

    (1) where the centre is, from the cloud's mean; (2) the neighbour's offset; (3) the point pair
    feature of the two: the angles between the centre's normal and the offset, between the
    neighbour's and the offset, and between the normals, and the offset's length. Neighbours are
    the ``k`` nearest within ``radius``; a place left over holds the centre itself. Normals are
    those given, or estimated from the ``k`` nearest points.

    Raises:
        ValueError: The cloud has fewer than ``k`` points.
    """
    distances, index = nearest(points, points, k)
    normals = estimate_normals(points, index) if normals is None else normals
    own = torch.arange(points.shape[1], device=points.device)[None, :, None]
    index = torch.where(distances <= radius**2, index, own)
    centre = (points - points.mean(dim=-2, keepdim=True)).unsqueeze(-2).expand(-1, -1, k, -1)
    offset = gather_points(points, index) - points.unsqueeze(-2)
    n_centre, n_neighbour = normals.unsqueeze(-2).expand_as(offset), gather_points(normals, index)
    pairs = ((n_centre, offset), (n_neighbour, offset), (n_centre, n_neighbour))
    angles = torch.stack([angle_between(a, b) for a, b in pairs], dim=-1)
    length = offset.norm(dim=-1, keepdim=True)
    return torch.cat([centre, offset, angles, length], dim=-1), index


@torch.no_grad()
def describe(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"] | None,
    radius: float,
    k: int,
) -> Float[Tensor, "batch n k 11"]:
    """The three descriptors of each point and its neighbours (Yuan et al. 2024, EGST).

    Those of :func:`neighbourhoods`, and the widest angle that the neighbour spans with any point
    of the cloud. The angles and the length do not change when the cloud moves, centre and offset
    turn with it.

    Raises:
        ValueError: The cloud has fewer than ``k`` points.
    """
    pairs, index = neighbourhoods(points, normals, radius, k)
    return torch.cat([pairs, widest_angle(points, index).unsqueeze(-1)], dim=-1)


@torch.no_grad()
def describe_pairs(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"] | None,
    radius: float,
    k: int,
) -> Float[Tensor, "batch n k 10"]:
    """RPM-Net's numbers of each point and its neighbours (Yew & Lee 2020, Sec. 4.1).

    Those of :func:`neighbourhoods`. Where ``normals`` is None they are estimated, and then each
    is a line without a direction: its angles are folded into [0, pi/2]. A direction could only
    come from the centroid, and two crops of one object have two.

    Raises:
        ValueError: The cloud has fewer than ``k`` points.
    """
    pairs, _ = neighbourhoods(points, normals, radius, k)
    if normals is None:
        angles = pairs[..., 6:9]
        pairs[..., 6:9] = torch.minimum(angles, torch.pi - angles)
    return pairs


def move(
    descriptors: Float[Tensor, "batch n k dim"], T: Float[Tensor, "batch 4 4"]
) -> Float[Tensor, "batch n k dim"]:
    """The descriptors of the moved cloud: centres move, offsets turn, the rest stays."""
    centre, offset, invariant = descriptors.tensor_split((3, 6), dim=-1)
    moved = transform(T, centre[:, :, 0]).unsqueeze(-2).expand_as(centre)
    turned = offset @ T[:, None, :3, :3].mT
    return torch.cat([moved, turned, invariant], dim=-1)


def widest_angle(
    points: Float[Tensor, "batch n 3"], index: Int[Tensor, "batch n k"]
) -> Float[Tensor, "batch n k"]:
    """Per neighbour, the largest angle at the centre between it and any point of the cloud.

    Over ``[n k n]`` triplets in blocks of centres; the largest angle has the smallest cosine. The
    centre itself spans no angle, so one of its neighbours stands in its place. A neighbour that is
    the centre has a right angle.
    """
    return torch.stack([_widest_angle(*cloud) for cloud in zip(points, index, strict=True)])


def _widest_angle(points: Float[Tensor, "n 3"], index: Int[Tensor, "n k"]) -> Float[Tensor, "n k"]:
    """:func:`widest_angle` of one cloud; few buffers, used again, so that they stay in the cache."""
    (n, k), axes = index.shape, points.mT.contiguous()
    offset = nn.functional.normalize(points[index] - points.unsqueeze(1), dim=-1)
    other = offset.norm(dim=-1).argmax(dim=-1)
    stand_in = offset[torch.arange(n, device=points.device), other]
    rows = min(n, max(1, TRIPLETS // (k * n)))
    to_all, scale = points.new_empty(3, rows, n), points.new_empty(rows, n)
    cosines, smallest = points.new_empty(rows, k, n), points.new_empty(n, k)
    for start in range(0, n, rows):
        block = slice(start, min(start + rows, n))
        here = slice(block.stop - start)
        x, y, z = rays = to_all[:, here]
        torch.sub(axes.unsqueeze(1), axes[:, block].unsqueeze(2), out=rays)
        torch.mul(x, x, out=scale[here]).addcmul_(y, y).addcmul_(z, z)
        rays.mul_(scale[here].clamp_(min=torch.finfo(points.dtype).tiny).rsqrt_())
        rays[:, :, block].diagonal(0, 1, 2).copy_(stand_in[block].mT)
        torch.bmm(offset[block], rays.transpose(0, 1), out=cosines[here])
        torch.amin(cosines[here], dim=-1, out=smallest[block])
    return smallest.clamp_(-1, 1).arccos_()


class StructureEmbedding(nn.Module):
    """Descriptors to one feature per point: an MLP per neighbour, the maximum, an MLP per point."""

    def __init__(self, dim: int, ins: int) -> None:
        """``dim`` of a point's feature; ``ins`` numbers describe a neighbour."""
        super().__init__()
        self.per_neighbour = nn.ModuleList(
            nn.Linear(i, o) for i, o in ((ins, dim), (dim, dim), (dim, 2 * dim))
        )
        self.per_point = nn.Sequential(
            nn.Linear(2 * dim, 2 * dim),
            nn.LayerNorm(2 * dim),
            nn.ReLU(),
            nn.Linear(2 * dim, dim),
            nn.LayerNorm(dim),
            nn.ReLU(),
            nn.Linear(dim, dim),
        )

    def forward(self, descriptors: Float[Tensor, "batch n k ins"]) -> Float[Tensor, "batch n dim"]:
        """The structured feature of each point."""
        features: Tensor = self.per_point(pool_edges(descriptors, self.per_neighbour, (2,)))
        return features
