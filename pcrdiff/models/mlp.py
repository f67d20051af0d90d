"""Linear layers followed by ReLU, started so that they neither shrink nor swell a signal."""

from collections.abc import Sequence

from torch import nn


def he_linear(ins: int, outs: int) -> nn.Linear:
    """A linear layer for a ReLU behind it (He et al. 2015).

    Without batch statistics torch's own start shrinks the signal by a factor of two a layer, and
    the first few hundred steps of training go into growing it again.
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
