"""Attention across clouds: which orders matter, and which do not."""

import pytest
import torch
from torch import Tensor

from pcrdiff.models.attention import CrossCloudAttention
from tests.pcrdiff.synthetic_clouds import seeded


def make(dim: int = 16, heads: int = 4) -> CrossCloudAttention:
    torch.manual_seed(0)
    return CrossCloudAttention(dim, heads).double()


def features(n: int, seed: int) -> Tensor:
    return torch.randn(2, n, 16, generator=seeded(seed), dtype=torch.float64)


def slow_twin(layer: CrossCloudAttention, own: Tensor, other: Tensor) -> Tensor:
    """Head by head, point by point, for one pair."""
    keys = torch.cat([layer.own(own), layer.other(other)])
    mixed = []
    for query, feature in zip(layer.query(own), own, strict=True):
        heads = []
        for h in range(layer.heads):
            part = slice(h * 16 // layer.heads, (h + 1) * 16 // layer.heads)
            weights = (keys[:, part] @ query[part] / (16 / layer.heads) ** 0.5).softmax(dim=0)
            heads.append(weights @ keys[:, part])
        mixed.append(layer.norm_attention(feature + layer.out(torch.cat(heads))))
    attended = torch.stack(mixed)
    result: Tensor = layer.norm_feed(attended + layer.feed(attended))
    unit: Tensor = result / result.norm(dim=-1, keepdim=True)
    return unit


@pytest.mark.parametrize(("n", "m"), [(6, 6), (5, 9), (9, 5), (1, 1)])
def test_agrees_with_a_slow_twin_for_any_two_sizes(n: int, m: int) -> None:
    layer, own, other = make(), features(n, 0), features(m, 1)
    expected = [slow_twin(layer, a, b) for a, b in zip(own, other, strict=True)]
    torch.testing.assert_close(layer(own, other), torch.stack(expected))


def test_follows_the_order_of_its_own_points() -> None:
    layer, own, other = make(), features(7, 2), features(9, 3)
    order = torch.randperm(7, generator=seeded(4))
    torch.testing.assert_close(layer(own[:, order], other), layer(own, other)[:, order])


def test_ignores_the_order_of_the_other_clouds_points() -> None:
    layer, own, other = make(), features(7, 2), features(9, 3)
    order = torch.randperm(9, generator=seeded(5))
    torch.testing.assert_close(layer(own, other[:, order]), layer(own, other))


def test_knows_of_the_other_cloud() -> None:
    layer, own = make(), features(7, 2)
    assert not torch.allclose(layer(own, features(9, 3)), layer(own, features(9, 4)), atol=1e-3)


def test_gives_unit_features() -> None:
    length = make()(features(7, 2), features(9, 3)).norm(dim=-1)
    torch.testing.assert_close(length, torch.ones(2, 7, dtype=torch.float64))
