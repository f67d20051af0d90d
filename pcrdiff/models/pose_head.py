"""Global features of two clouds to a pose."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize

from pcrdiff.models.mlp import he_layers


class PoseHead(nn.Module):
    """PCRNet's fully connected head: two features to a 7-vector with a unit quaternion."""

    def __init__(self, dim: int, widths: Sequence[int]) -> None:
        """``dim`` of both features together; ``widths`` of the hidden layers."""
        super().__init__()
        self.layers = nn.Sequential(*he_layers(dim, widths), nn.Linear(widths[-1], 7))

    def forward(
        self, source: Float[Tensor, "batch half"], target: Float[Tensor, "batch half"]
    ) -> Float[Tensor, "batch 7"]:
        """The pose vector, read as a step away from the identity."""
        raw = self.layers(torch.cat([source, target], dim=-1))
        identity = torch.tensor([1.0, 0, 0, 0, 0, 0, 0]).to(raw)
        quaternion, t = (raw + identity).split([4, 3], dim=-1)
        return torch.cat([normalize(quaternion, dim=-1), t], dim=-1)
