"""PointNet: one feature for a whole cloud."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any, cast

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pcrdiff.geometry.neighbors import row_argmax
from pcrdiff.geometry.precision import search_precision, search_scores
from pcrdiff.models.mlp import he_layers

BLOCK = 1024  # points whose scores are held at once: those of 1024 channels are 4 MiB
warnings.filterwarnings("ignore", message="Sparse CSR tensor support is in beta state")


class PointNet(nn.Module):
    """A shared MLP on every point, then the maximum over points (Qi et al. 2017; Sec. 3.4).

    No T-net and no batch statistics: a cloud's feature depends on that cloud alone. Training
    differentiates through the critical points only: a maximum passes its gradient to the point
    that attains it and to no other, so the gradient is that of the plain network. They are
    searched in the precision that is set (:mod:`pcrdiff.geometry.precision`); features and
    gradients are those of the points found, in the network's own precision.
    """

    def __init__(self, widths: Sequence[int], ins: int = 3) -> None:
        """``widths`` of the layers, the last one the feature's; ``ins`` numbers per point."""
        super().__init__()
        self.per_point = nn.Sequential(*he_layers(ins, widths))

    @property
    def hidden(self) -> nn.Sequential:
        """All layers but the last."""
        return cast(nn.Sequential, self.per_point[:-2])

    @property
    def last(self) -> nn.Linear:
        """The layer behind which the maximum is taken; its ReLU may come before or after that."""
        return cast(nn.Linear, self.per_point[-2])

    def forward(self, points: Float[Tensor, "batch n ins"]) -> Float[Tensor, "batch dim"]:
        """The cloud's global feature."""
        if not torch.is_grad_enabled() and search_precision() == "float32":
            return (self.highest_scores(points) + self.last.bias).relu()
        critical = self.critical_points(points)
        chosen, place = torch.unique(critical, return_inverse=True)
        hidden = self.hidden(points.flatten(0, 1)[chosen])
        return (at_critical(hidden, self.last.weight, place) + self.last.bias).relu()

    def highest_scores(self, points: Float[Tensor, "batch n ins"]) -> Float[Tensor, "batch dim"]:
        """Each channel's maximum over the points, before its bias and ReLU: both keep the order."""
        hidden, weight = self.hidden, self.last.weight
        highest = [
            torch.stack([(weight @ hidden(block).mT).amax(dim=-1) for block in cloud.split(BLOCK)])
            for cloud in points
        ]
        return torch.stack(highest).amax(dim=1)

    @torch.no_grad()
    def critical_points(self, points: Float[Tensor, "batch n ins"]) -> Int[Tensor, "batch dim"]:
        """Row, in the batch's points stacked, of the point that attains each maximum.

        Cloud by cloud, because the scores of one just fit into the cache; channels come first,
        so that the search runs along memory.
        """
        hidden, weight = self.hidden, self.last.weight
        highest = torch.stack(
            [row_argmax(search_scores(weight, hidden(cloud))) for cloud in points]
        )
        starts = points.shape[1] * torch.arange(len(points), device=points.device)
        return highest + starts.unsqueeze(-1)


class AtCritical(torch.autograd.Function):
    """A linear layer's output, each channel at one row alone: ``w_c . h_place(b,c)``.

    The maximum keeps ``batch x dim`` of the ``rows x dim`` products. They are the entries of a
    sparse matrix with one column per row of ``hidden``, and so is its gradient.
    """

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401  torch gives it no type
        hidden: Float[Tensor, "rows width"],
        weight: Float[Tensor, "dim width"],
        place: Int[Tensor, "batch dim"],
    ) -> Float[Tensor, "batch dim"]:
        """Pick ``hidden[place[b, c]] . weight[c]``."""
        ctx.save_for_backward(hidden, weight, place)
        picked = _entries(torch.zeros_like(place, dtype=weight.dtype), place, len(hidden))
        products = torch.sparse.sampled_addmm(picked, weight, hidden.mT, beta=0.0)
        values: Tensor = products.values()
        return values.view(place.mT.shape).mT

    @staticmethod
    def backward(
        ctx: Any,  # noqa: ANN401  torch gives it no type
        *gradients: Float[Tensor, "batch dim"],
    ) -> tuple[Float[Tensor, "rows width"], Float[Tensor, "dim width"], None]:
        """``G^T W`` and ``G H`` for the sparse G."""
        hidden, weight, place = ctx.saved_tensors
        G = _entries(gradients[0], place, len(hidden))
        return G.mT @ weight, G @ hidden, None


at_critical = cast("Callable[[Tensor, Tensor, Tensor], Tensor]", AtCritical.apply)
""":class:`AtCritical` as a function."""


def _entries(
    values: Float[Tensor, "batch dim"], place: Int[Tensor, "batch dim"], rows: int
) -> Float[Tensor, "dim rows"]:
    """The sparse matrix with ``values[b, c]`` in row c and column ``place[b, c]``."""
    batch, dim = place.shape
    starts = torch.arange(0, dim * batch + 1, batch, device=place.device)
    return torch.sparse_csr_tensor(
        starts, place.mT.flatten(), values.mT.flatten(), (dim, rows), check_invariants=False
    )
