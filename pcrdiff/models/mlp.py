"""Linear layers followed by ReLU, initialised to keep the scale of a signal."""

from collections.abc import Sequence

from jaxtyping import Float
from torch import Tensor, nn


def he_linear(ins: int, outs: int) -> nn.Linear:
    """A linear layer for a ReLU behind it (He et al. 2015).

    Without batch statistics torch's own initialisation halves the signal in each layer, and the
    first few hundred steps of training only restore it.
    """
    layer = nn.Linear(ins, outs)
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    nn.init.zeros_(layer.bias)
    return layer


def he_layers(ins: int, widths: Sequence[int]) -> list[nn.Module]:
    """Linear layers of ``widths`` outputs, each with its ReLU."""
    starts = [ins, *widths[:-1]]
    pairs = [(he_linear(i, o), nn.ReLU()) for i, o in zip(starts, widths, strict=True)]
    return [part for pair in pairs for part in pair]


class PoseHead(nn.Module):
    """PCRNet's fully connected head: concatenated features to a step of the pose vector."""

    def __init__(self, dim: int, widths: Sequence[int], outs: int) -> None:
        """``dim`` of the features together; ``widths`` of the hidden layers; ``outs`` entries."""
        super().__init__()
        self.layers = nn.Sequential(*he_layers(dim, widths), nn.Linear(widths[-1], outs))

    def forward(self, features: Float[Tensor, "batch dim"]) -> Float[Tensor, "batch outs"]:
        """The step away from where the answer starts, in the entries of the vector."""
        raw: Tensor = self.layers(features)
        return raw
