"""DGCNN: one feature per point, from the edges to its neighbours (Wang et al. 2019)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.geometry.neighbors import gather_points, nearest
from pcrdiff.models.edge_mlp import pool_edges
from pcrdiff.models.mlp import he_layers, he_linear


class DGCNN(nn.Module):
    """An MLP on every edge; the maximum over a point's edges after each layer; all maxima joined.

    As in DCP (Wang & Solomon 2019, Sec. 4.1): the graph is that of the points, the same for all
    layers, and an edge is described by the positions of both its ends, from the cloud's mean.
    No batch statistics: a cloud's features depend on that cloud alone.
    """

    def __init__(self, dim: int, neighbours: int) -> None:
        """``dim`` of a point's feature; ``neighbours`` of a point, itself included."""
        super().__init__()
        widths = (dim // 2, dim // 2, dim, dim)
        starts = (6, *widths[:-1])
        self.per_edge = nn.ModuleList(he_linear(i, o) for i, o in zip(starts, widths, strict=True))
        self.join = nn.Sequential(*he_layers(sum(widths), (dim,)))
        self.neighbours = neighbours

    def forward(self, points: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch n dim"]:
        """The points' features.

        Raises:
            ValueError: There are fewer points than neighbours.
        """
        _, index = nearest(points, points, self.neighbours)
        centred = points - points.mean(dim=-2, keepdim=True)
        ends = gather_points(centred, index)
        edges = torch.cat([ends, centred.unsqueeze(-2).expand_as(ends)], dim=-1)
        features: Tensor = self.join(pool_edges(edges, self.per_edge, range(len(self.per_edge))))
        return features
