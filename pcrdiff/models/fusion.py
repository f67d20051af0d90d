"""Where the noisy pose's feature joins those of the clouds (Table 5)."""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

Fusion = Literal["source", "target", "concat"]
FEATURES: dict[Fusion, int] = {"source": 2, "target": 2, "concat": 3}
"""How many features wide the fused one is."""


def fuse(
    fusion: Fusion,
    pose: Float[Tensor, "batch dim"],
    source: Float[Tensor, "batch dim"],
    target: Float[Tensor, "batch dim"],
) -> Float[Tensor, "batch wide"]:
    """F_t added to F_P or to F_Q before these stand side by side, or all three side by side."""
    if fusion == "source":
        return torch.cat([source + pose, target], dim=-1)
    if fusion == "target":
        return torch.cat([source, target + pose], dim=-1)
    return torch.cat([source, target, pose], dim=-1)
