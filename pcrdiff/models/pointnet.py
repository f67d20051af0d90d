"""PointNet: one feature for a whole cloud."""

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcrdiff.models.mlp import he_layers


class PointNet(nn.Module):
    """A shared MLP on every point, then the maximum over points (Qi et al. 2017; Sec. 3.4).

    No T-net and no batch statistics: a cloud's feature depends on that cloud alone. Training
    differentiates through the critical points only: a maximum passes its gradient to the point
    that attains it and to no other, so the gradient is that of the plain network.
    """

    def __init__(self, widths: Sequence[int], ins: int = 3) -> None:
        """``widths`` of the layers, the last one the feature's; ``ins`` numbers tell of a point."""
        super().__init__()
        self.per_point = nn.Sequential(*he_layers(ins, widths))

    def forward(self, points: Float[Tensor, "batch n ins"]) -> Float[Tensor, "batch dim"]:
        """The cloud's global feature."""
        if not torch.is_grad_enabled():
            pooled: Tensor = self.per_point(points).amax(dim=-2)
            return pooled
        critical = self.critical_points(points)
        chosen, place = torch.unique(critical, return_inverse=True)
        features: Tensor = self.per_point(points.flatten(0, 1)[chosen])
        return features.gather(0, place)

    @torch.no_grad()
    def critical_points(self, points: Float[Tensor, "batch n ins"]) -> Int[Tensor, "batch dim"]:
        """Row, in the batch's points stacked, of the point that attains each maximum.

        Channels lead here, so that the search runs along memory.
        """
        batch, n, _ = points.shape
        features = points.flatten(0, 1).T
        for layer in self.per_point:
            if isinstance(layer, nn.Linear):
                features = torch.addmm(layer.bias.unsqueeze(-1), layer.weight, features).relu_()
        highest = features.reshape(len(features), batch, n).max(dim=-1).indices
        return highest.T + n * torch.arange(batch, device=points.device).unsqueeze(-1)
