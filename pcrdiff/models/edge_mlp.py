"""An MLP on every edge of a graph of points, and the maximum over each point's edges.

There are k edges per point, so what a plain graph keeps of them is most of the memory of a
training step, and fetching it again most of the time. Here a block of points that fits the cache
goes through all layers at once; only the edges and the index of the edge that attained each
maximum are kept, and the backward pass computes the layers in between again.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

threshold_backward = torch.ops.aten.threshold_backward
"""The gradient before a ReLU, of that after it and what the ReLU gave."""

BLOCK_EDGES = 2048
"""Edges at once; a layer of 128 channels on them is 1 MiB in float32."""
MOST_EDGES = 256
"""The most edges that a point may have: the one that attains a maximum is kept in a byte."""


def pool_edges(
    edges: Float[Tensor, "*batch n k ins"], layers: Iterable[nn.Module], pooled: Sequence[int]
) -> Float[Tensor, "*batch n pooled_channels"]:
    """The maximum over a point's edges of what the layers compute, a ReLU after each.

    The gradient of a maximum goes to one edge that attains it.

    Args:
        edges: The numbers that describe each edge of each point.
        layers: Linear ones with a bias, applied one after the other.
        pooled: The layers after which the maximum is taken, counted from 0, in order; the last
            layer is one of them. The maxima are concatenated.

    Raises:
        ValueError: A point has more than ``MOST_EDGES`` edges.
    """
    if edges.shape[-2] > MOST_EDGES:
        raise ValueError(f"pool_edges needs at most {MOST_EDGES} edges, got {edges.shape[-2]}")
    parameters = [p for layer in layers for p in layer.parameters()]  # a weight, a bias, ...
    flat = edges.reshape(-1, *edges.shape[-2:])
    if torch.is_grad_enabled():
        result: Tensor = _PoolEdges.apply(flat, tuple(pooled), *parameters)  # type: ignore[no-untyped-call]
    else:
        result, _ = _maxima(flat, pooled, parameters, indices=False)
    return result.view(*edges.shape[:-2], -1)


class _PoolEdges(torch.autograd.Function):
    """Forward and backward in blocks of points."""

    @staticmethod
    def forward(ctx: Any, edges: Tensor, pooled: tuple[int, ...], *parameters: Tensor) -> Tensor:  # noqa: ANN401
        maxima, attained = _maxima(edges, pooled, parameters, indices=True)
        ctx.pooled = pooled
        ctx.save_for_backward(edges, maxima, attained, *parameters)
        return maxima

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401
        edges, maxima, attained, *parameters = ctx.saved_tensors
        gradient = torch.where(maxima > 0, gradient, 0)  # the last ReLU before each maximum
        sums = [
            torch.zeros_like(p.mT, memory_format=torch.contiguous_format)
            if p.dim() == 2
            else torch.zeros_like(p)
            for p in parameters
        ]
        to_edges = torch.empty_like(edges) if ctx.needs_input_grad[0] else None
        for block in _blocks(edges):
            hidden = _hidden(edges[block].flatten(0, 1), parameters[:-2])
            down = _descend(hidden, gradient[block], attained[block], ctx.pooled, parameters, sums)
            if to_edges is not None:
                to_edges[block] = (down @ parameters[0]).view_as(edges[block])
        return to_edges, None, *(each.mT if each.dim() == 2 else each for each in sums)


def _blocks(edges: Float[Tensor, "n k ins"]) -> Iterator[slice]:
    points = max(1, BLOCK_EDGES // edges.shape[1])
    for start in range(0, len(edges), points):
        yield slice(start, start + points)


def _hidden(
    edges: Float[Tensor, "edges ins"], parameters: Sequence[Tensor]
) -> list[Float[Tensor, "edges _"]]:
    """The edges, and the output of each layer."""
    hidden = [edges]
    for weight, bias in zip(parameters[::2], parameters[1::2], strict=True):
        hidden.append(torch.addmm(bias, hidden[-1], weight.mT).relu_())
    return hidden


def _maxima(
    edges: Float[Tensor, "n k ins"],
    pooled: Sequence[int],
    parameters: Sequence[Tensor],
    *,
    indices: bool,
) -> tuple[Float[Tensor, "n channels"], UInt8[Tensor, "n channels"] | None]:
    """The maxima, and on request the edge that attains each; the last one of equals."""
    n, k, _ = edges.shape
    widths = [len(parameters[2 * layer]) for layer in pooled]
    maxima = edges.new_empty(n, sum(widths))
    attained = torch.empty_like(maxima, dtype=torch.uint8) if indices else None
    places = torch.arange(k).to(edges).view(k, 1)
    for block in _blocks(edges):
        hidden = _hidden(edges[block].flatten(0, 1), parameters)
        start = 0
        for layer, width in zip(pooled, widths, strict=True):
            part = slice(start, start + width)
            values = hidden[layer + 1].view(-1, k, width)
            highest = values.amax(dim=1)
            maxima[block, part] = highest
            if attained is not None:
                attains = values.eq_(highest.unsqueeze(1))  # in place: one pass in the cache
                attained[block, part] = attains.mul_(places).amax(dim=1)
            start += width
    return maxima, attained


def _descend(
    hidden: Sequence[Float[Tensor, "edges _"]],
    gradient: Float[Tensor, "points channels"],
    attained: UInt8[Tensor, "points channels"],
    pooled: Sequence[int],
    parameters: Sequence[Tensor],
    sums: list[Tensor],
) -> Float[Tensor, "edges _"]:
    """Add a block's gradients to ``sums``; return that of the first layer before its ReLU."""
    k = len(hidden[0]) // len(gradient)
    widths = [len(parameters[2 * layer]) for layer in pooled]
    spreads = {
        layer: _spread(g, a, k)
        for layer, g, a in zip(
            pooled, torch.split(gradient, widths, 1), torch.split(attained, widths, 1), strict=True
        )
    }
    last = len(hidden) - 1
    down = spreads[last]
    for layer in range(last, -1, -1):
        # This way round a product with few `ins` is five times faster.
        sums[2 * layer].addmm_(hidden[layer].mT, down)
        sums[2 * layer + 1].add_(down.sum(dim=0))
        if layer > 0:
            down = threshold_backward(down @ parameters[2 * layer], hidden[layer], 0)
        if layer - 1 in spreads:
            down.add_(spreads[layer - 1])
    return down


def _spread(
    gradient: Float[Tensor, "points outs"], attained: UInt8[Tensor, "points outs"], k: int
) -> Float[Tensor, "points*{k} outs"]:
    """Each maximum's gradient at the edge that attained it, zero at the others."""
    points, outs = gradient.shape
    spread = gradient.new_zeros(points, k, outs)
    spread.scatter_(1, attained.long().unsqueeze(1), gradient.unsqueeze(1))
    return spread.view(points * k, outs)
