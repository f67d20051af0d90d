"""EGST's transformer layer: each point attends to its own cloud and to the other one."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize, scaled_dot_product_attention


class CrossCloudAttention(nn.Module):
    """One layer, four heads, shared by both clouds (Yuan et al. 2024).

    EGST adds the score of point j of the other cloud to that of point j of its own, which makes
    the answer depend on the order of the points and needs N = M. Here the points of both clouds
    share one softmax: the same keys, in any order, for any N and M.
    """

    def __init__(self, dim: int, heads: int = 4) -> None:
        """``dim`` of the features, a multiple of ``heads``."""
        super().__init__()
        self.heads = heads
        self.own = nn.Linear(dim, dim, bias=False)  # Q = K = V in EGST
        self.query = nn.Linear(dim, dim, bias=False)
        self.other = nn.Linear(dim, dim, bias=False)
        self.out = nn.Linear(dim, dim)
        self.feed = nn.Sequential(nn.Linear(dim, 2 * dim), nn.ReLU(), nn.Linear(2 * dim, dim))
        self.norm_attention, self.norm_feed = nn.LayerNorm(dim), nn.LayerNorm(dim)

    def forward(
        self, features: Float[Tensor, "batch n dim"], other: Float[Tensor, "batch m dim"]
    ) -> Float[Tensor, "batch n dim"]:
        """Unit features of the first cloud, conditioned on the second."""
        query = self._split(self.query(features))
        keys = self._split(torch.cat([self.own(features), self.other(other)], dim=1))
        attended = scaled_dot_product_attention(query, keys, keys)
        mixed = self.norm_attention(features + self.out(attended.transpose(1, 2).flatten(2)))
        return normalize(self.norm_feed(mixed + self.feed(mixed)), dim=-1)

    def _split(self, x: Float[Tensor, "batch points dim"]) -> Float[Tensor, "batch h points d"]:
        batch, points, dim = x.shape
        return x.view(batch, points, self.heads, dim // self.heads).transpose(1, 2)
