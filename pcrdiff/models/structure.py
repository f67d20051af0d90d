"""EGST's structured feature: three descriptors of each neighbourhood, embedded per point."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcrdiff.geometry.neighbors import BLOCK, estimate_normals, gather_points, nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.registration import Normals

DESCRIPTOR_DIM, PAIR_DIM = 11, 10  # of EGST, of RPM-Net


def split_normals(
    who: str, cloud: Float[Tensor, "batch n channels"], normals: Normals
) -> tuple[Float[Tensor, "batch n 3"], Float[Tensor, "batch n 3"] | None]:
    """Points, and their unit normals where these are given.

    Raises:
        ValueError: The cloud comes without the normals, or with some that are not asked for.
    """
    wanted = 6 if normals == "given" else 3
    if cloud.shape[-1] != wanted:
        raise ValueError(
            f"{who} with {normals} normals needs {wanted} channels, got {cloud.shape[-1]}"
        )
    return cloud[..., :3], cloud[..., 3:] if normals == "given" else None


def angle_between(
    a: Float[Tensor, "*batch 3"], b: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch"]:
    """Angle in [0, pi], accurate everywhere; 0 where a vector vanishes."""
    return torch.atan2(torch.linalg.cross(a, b).norm(dim=-1), (a * b).sum(dim=-1))


@dataclass(frozen=True)
class Neighbourhoods:
    """Each point and its neighbours."""

    index: Int[Tensor, "batch n k"]
    centre: Float[Tensor, "batch n k 3"]
    """The point, from the cloud's mean."""
    offset: Float[Tensor, "batch n k 3"]
    """From the point to its neighbour."""
    angles: Float[Tensor, "batch n k 3"]
    """Of the point's normal and the offset, of the neighbour's and the offset, of the normals."""


def neighbourhoods(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"] | None,
    radius: float,
    k: int,
) -> Neighbourhoods:
    """The ``k`` nearest points within ``radius``; a place left over holds the centre itself.

    Normals are those given, or estimated from the ``k`` nearest points.

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
    return Neighbourhoods(index, centre, offset, angles)


@torch.no_grad()
def describe(
    points: Float[Tensor, "batch n 3"],
    radius: float,
    k: int,
    normals: Float[Tensor, "batch n 3"] | None = None,
) -> Float[Tensor, "batch n k 11"]:
    """The three descriptors of each point and its neighbours (Yuan et al. 2024, EGST).

    (1) where the centre is, from the cloud's mean; (2) the neighbour's offset; (3) the point
    pair feature of the two, and the widest angle that the neighbour spans with any point of the
    cloud. (3) does not change when the cloud moves, (1) and (2) turn with it. Neighbours are the
    ``k`` nearest within ``radius``; a place left over holds the centre itself. Normals are
    those given, or estimated from the ``k`` nearest points.

    Raises:
        ValueError: The cloud has fewer than ``k`` points.
    """
    near = neighbourhoods(points, normals, radius, k)
    return torch.cat(
        [
            near.centre,
            near.offset,
            near.angles,
            near.offset.norm(dim=-1, keepdim=True),
            widest_angle(points, near.index).unsqueeze(-1),
        ],
        dim=-1,
    )


@torch.no_grad()
def describe_pairs(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"] | None,
    radius: float,
    k: int,
) -> Float[Tensor, "batch n k 10"]:
    """RPM-Net's numbers of each point and its neighbours (Yew & Lee 2020, Sec. 4.1).

    (1) where the centre is, from the cloud's mean; (2) the neighbour's offset; (3) the point pair
    feature of the two. :func:`move` says what a motion does to them. Neighbours are those of
    :func:`describe`. Where ``normals`` is None they are estimated, and then each is a line without
    a direction: its angles are folded into [0, pi/2]. A direction could only come from the
    centroid, and two crops of one object have two.

    Raises:
        ValueError: The cloud has fewer than ``k`` points.
    """
    near = neighbourhoods(points, normals, radius, k)
    angles = near.angles
    if normals is None:
        angles = torch.minimum(angles, torch.pi - angles)
    length = near.offset.norm(dim=-1, keepdim=True)
    return torch.cat([near.centre, near.offset, angles, length], dim=-1)


def move(
    descriptors: Float[Tensor, "batch n k dim"], T: Float[Tensor, "batch 4 4"]
) -> Float[Tensor, "batch n k dim"]:
    """What a moved cloud's descriptors are: centres move, offsets turn, the rest stays."""
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
    batch, n, k = index.shape
    rows = max(1, BLOCK // (batch * k * n))
    offset = nn.functional.normalize(gather_points(points, index) - points.unsqueeze(-2), dim=-1)
    other = offset.norm(dim=-1).argmax(dim=-1)[..., None, None]
    stand_in = offset.take_along_dim(other, dim=2).squeeze(2)
    cosines = []
    for start in range(0, n, rows):
        centres = points[:, start : start + rows]
        to_all = nn.functional.normalize(points.unsqueeze(1) - centres.unsqueeze(2), dim=-1)
        to_all.diagonal(start, 1, 2).copy_(stand_in[:, start : start + rows].mT)
        cosines.append((offset[:, start : start + rows] @ to_all.mT).amin(dim=-1))
    return torch.arccos(torch.cat(cosines, dim=1).clamp(-1, 1))


class StructureEmbedding(nn.Module):
    """Descriptors to one feature per point: an MLP per neighbour, the maximum, an MLP per point."""

    def __init__(self, dim: int, ins: int = DESCRIPTOR_DIM) -> None:
        """``dim`` of a point's feature, 128 in EGST; ``ins`` numbers tell of a neighbour."""
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
        features = descriptors
        for layer in self.per_neighbour:
            features = layer(features).relu()
        pooled: Tensor = self.per_point(features.max(dim=-2).values)
        return pooled
