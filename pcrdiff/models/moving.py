"""Points described by what no motion changes and by what moves with the cloud.

A motion of the cloud is applied to its description exactly, without touching the cloud or searching
for neighbours again. So a step of a walk sees where the noisy pose lays the source, at the price of
one small layer. The lengths that it is scaled by belong to clouds in the unit sphere.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcrdiff.geometry.neighbors import estimate_normals, gather_points, nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.edge_mlp import pool_edges

NEAR, FAR, STRIDE = 16, 64, 4
"""Neighbours of a point's small patch; of its wide one, of which every fourth is looked at."""
PATCHES, EDGE, SHAPE = 2, 4, 5
"""Patches of a point; numbers of an edge, and of a patch that no motion changes."""
MOVING = 3 + (3 + 6) * PATCHES
"""Numbers of a point that move with the cloud."""
LEAST = 1e-12
"""Keeps what is divided by finite where points coincide."""


@dataclass(frozen=True)
class Patch:
    """The neighbours of every point of a cloud, at one size."""

    edges: Float[Tensor, "batch n k 4"]
    """How both normals and the offset lie to each other, as cosines without sign, and its length."""
    offset: Float[Tensor, "batch n 3"]
    """From the point to the patch's mean; the unit is an eighth."""
    spread: Float[Tensor, "batch n 3 3"]
    """The patch's covariance, scaled to trace 3."""
    shape: Float[Tensor, "batch n 5"]
    """The offset's length and its part along the normal, and the eigenvalues of the spread."""


@dataclass(frozen=True)
class Described:
    """A cloud about its centroid, point by point."""

    points: Float[Tensor, "batch n 3"]
    invariant: Float[Tensor, "batch n dim"]
    """What no motion changes, embedded."""
    offsets: Float[Tensor, "batch n patches 3"]
    spreads: Float[Tensor, "batch n patches 3 3"]

    def with_context(self, context: Float[Tensor, "batch n dim"]) -> "Described":
        """The same cloud, and beside each point what the other cloud says of it."""
        return replace(self, invariant=self.invariant + context)

    def moved(self, T: Float[Tensor, "batch 4 4"]) -> Float[Tensor, "batch n moving"]:
        """Where each point and its patches lie once the cloud has moved."""
        R = T[:, None, :3, :3]
        turned = R.unsqueeze(1) @ self.spreads @ R.unsqueeze(1).mT
        rows, columns = torch.triu_indices(3, 3)
        parts = 2 * transform(T, self.points), (self.offsets @ R.mT).flatten(2)
        return torch.cat([*parts, turned[..., rows, columns].flatten(2)], dim=-1)


def patch(
    points: Float[Tensor, "batch n 3"],
    normals: Float[Tensor, "batch n 3"],
    index: Int[Tensor, "batch n k"],
) -> Patch:
    """Describe the neighbours at ``index``; the sign of a normal does not matter."""
    to_neighbour = gather_points(points, index) - points.unsqueeze(-2)
    length = to_neighbour.norm(dim=-1, keepdim=True)
    along = to_neighbour / length.clamp(min=LEAST)
    own, other = normals.unsqueeze(-2).expand_as(along), gather_points(normals, index)
    cosines = [(a * b).sum(dim=-1).abs() for a, b in ((own, along), (other, along), (own, other))]
    offset = to_neighbour.mean(dim=-2)
    centred = to_neighbour - offset.unsqueeze(-2)
    spread = centred.mT @ centred
    trace = spread.diagonal(dim1=-2, dim2=-1).sum(dim=-1).clamp(min=LEAST)
    spread = 3 * spread / trace[..., None, None]
    part = (offset * normals).sum(dim=-1, keepdim=True).abs()
    shape = [offset.norm(dim=-1, keepdim=True), part, torch.linalg.eigvalsh(spread)]
    edges = torch.cat([torch.stack(cosines, dim=-1), 4 * length], dim=-1)
    return Patch(edges, 8 * offset, spread, torch.cat(shape, dim=-1))


class MovingEmbedding(nn.Module):
    """Two patches of every point, the wide one through the features of the small ones in it."""

    def __init__(self, dim: int) -> None:
        """``dim`` of a point's feature."""
        super().__init__()
        self.small = nn.ModuleList([nn.Linear(EDGE, dim // 2), nn.Linear(dim // 2, dim)])
        self.joint = nn.Sequential(nn.Linear(dim + SHAPE * PATCHES, dim), nn.ReLU())
        self.wide = nn.ModuleList([nn.Linear(EDGE + dim, dim), nn.Linear(dim, 2 * dim)])
        self.point = nn.Sequential(
            nn.Linear(3 * dim + SHAPE * PATCHES, 2 * dim),
            nn.LayerNorm(2 * dim),
            nn.ReLU(),
            nn.Linear(2 * dim, dim),
        )

    def forward(self, points: Float[Tensor, "batch n 3"]) -> Described:
        """Describe clouds that lie about their centroids."""
        with torch.no_grad():
            _, index = nearest(points, points, min(FAR, points.shape[1]))
            normals = estimate_normals(points, index[..., :NEAR])
            far = index[..., STRIDE - 1 :: STRIDE]
            small, wide = (patch(points, normals, each) for each in (index[..., :NEAR], far))
            shape = torch.cat([small.shape, wide.shape], dim=-1)
        local = self.joint(torch.cat([pool_edges(small.edges, self.small, (1,)), shape], dim=-1))
        edges = torch.cat([wide.edges, gather_points(local, far)], dim=-1)
        invariant = self.point(torch.cat([local, pool_edges(edges, self.wide, (1,)), shape], -1))
        offsets = torch.stack([small.offset, wide.offset], dim=-2)
        return Described(points, invariant, offsets, torch.stack([small.spread, wide.spread], -3))
