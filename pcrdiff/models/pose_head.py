"""Global features to a pose."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.models.mlp import he_layers


class PoseHead(nn.Module):
    """PCRNet's fully connected head: features side by side to a step of the pose vector."""

    def __init__(self, dim: int, widths: Sequence[int], outs: int) -> None:
        """``dim`` of the features together; ``widths`` of the hidden layers; ``outs`` entries."""
        super().__init__()
        self.layers = nn.Sequential(*he_layers(dim, widths), nn.Linear(widths[-1], outs))

    def forward(self, features: Float[Tensor, "batch dim"]) -> Float[Tensor, "batch outs"]:
        """The step away from where the answer starts, in the entries of the vector."""
        raw: Tensor = self.layers(features)
        return raw
