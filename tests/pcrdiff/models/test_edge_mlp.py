"""Pooled edges: what the plain formulation says, values and gradients, whatever the blocks."""

import pytest
import torch
from torch import Tensor, nn

from pcrdiff.models import edge_mlp
from pcrdiff.models.edge_mlp import pool_edges
from tests.pcrdiff.synthetic_clouds import seeded

Pooled = tuple[int, ...]
POOLED: list[Pooled] = [(2,), (0, 2), (0, 1, 2)]


def make() -> nn.ModuleList:
    torch.manual_seed(0)
    return nn.ModuleList(nn.Linear(i, o) for i, o in ((5, 8), (8, 7), (7, 12))).double()


def edges(n: int = 9, k: int = 6) -> Tensor:
    return torch.randn(2, n, k, 5, generator=seeded(1), dtype=torch.float64)


def plainly(values: Tensor, layers: nn.ModuleList, pooled: Pooled) -> Tensor:
    maxima = []
    for place, layer in enumerate(layers):
        values = layer(values).relu()
        if place in pooled:
            maxima.append(values.max(dim=-2).values)
    return torch.cat(maxima, dim=-1)


def gradients(result: Tensor, *inputs: Tensor) -> tuple[Tensor, ...]:
    pull = torch.randn(result.shape, generator=seeded(2), dtype=torch.float64)
    return torch.autograd.grad((result * pull).sum(), inputs)


@pytest.mark.parametrize("pooled", POOLED)
@pytest.mark.parametrize("block", [1, 6 * 4, 2048])
def test_agrees_with_the_plain_formulation(
    pooled: Pooled, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(edge_mlp, "BLOCK_EDGES", block)
    layers, told = make(), edges().requires_grad_()
    pooled_values, expected = pool_edges(told, layers, pooled), plainly(told, layers, pooled)
    torch.testing.assert_close(pooled_values, expected)
    inputs = (told, *layers.parameters())
    for got, wanted in zip(
        gradients(pooled_values, *inputs), gradients(expected, *inputs), strict=True
    ):
        assert wanted.abs().max() > 0
        torch.testing.assert_close(got, wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("pooled", POOLED)
def test_gives_the_same_without_a_graph(pooled: Pooled) -> None:
    layers = make()
    with torch.no_grad():
        alone = pool_edges(edges(), layers, pooled)
    assert torch.equal(alone, pool_edges(edges(), layers, pooled))


def test_of_equal_edges_one_takes_the_gradient() -> None:
    layers = make()
    twice = edges(k=3)[:, :, [0, 1, 2, 0, 1, 2]].requires_grad_()
    (got,) = gradients(pool_edges(twice, layers, (2,)), twice)
    (wanted,) = gradients(plainly(twice, layers, (2,)), twice)
    torch.testing.assert_close(got.view(2, 9, 2, 3, 5).sum(2), wanted.view(2, 9, 2, 3, 5).sum(2))


def test_keeps_the_edges_and_a_byte_a_maximum_and_no_layer() -> None:
    layers, told, kept = make(), edges(), {}

    def pack(tensor: Tensor) -> Tensor:
        kept[tensor.untyped_storage().data_ptr()] = tensor.untyped_storage().nbytes()
        return tensor

    with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
        result = pool_edges(told, layers, (2,))
    parameters = sum(p.numel() for p in layers.parameters())
    assert sum(kept.values()) == 8 * (told.numel() + result.numel() + parameters) + result.numel()


def test_refuses_more_edges_than_a_byte_can_count() -> None:
    with pytest.raises(ValueError, match="at most 256 edges, got 257"):
        pool_edges(edges(1, 257), make(), (2,))
