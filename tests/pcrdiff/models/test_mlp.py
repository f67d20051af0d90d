"""Layers that keep the scale of a signal at the start, and the head made of them."""

import pytest
import torch
from torch import nn

from pcrdiff.models.mlp import PoseHead, he_layers, he_linear
from tests.pcrdiff.synthetic_clouds import seeded


def test_every_width_gets_its_layer_and_its_relu() -> None:
    layers = he_layers(3, (8, 16, 4))
    shapes = [(p.in_features, p.out_features) for p in layers if isinstance(p, nn.Linear)]
    assert shapes == [(3, 8), (8, 16), (16, 4)]
    assert [type(part) for part in layers] == [nn.Linear, nn.ReLU] * 3


def test_a_layer_starts_without_bias_and_with_the_deviation_of_he() -> None:
    torch.manual_seed(0)
    layer = he_linear(200, 500)
    assert (layer.bias == 0).all()
    assert layer.weight.std().item() == pytest.approx((2 / 200) ** 0.5, rel=0.02)


def test_a_signal_keeps_its_power_through_ten_layers() -> None:
    torch.manual_seed(0)
    x = torch.randn(64, 256, generator=seeded(0))
    power = nn.Sequential(*he_layers(256, (256,) * 10))(x).square().mean().item()
    assert 0.3 < power < 3  # torch's own start leaves about 1e-7


def make_head() -> PoseHead:
    torch.manual_seed(0)
    return PoseHead(dim=32, widths=(24, 12), outs=9)


def test_gives_one_step_a_pair_with_as_many_entries_as_asked() -> None:
    step = make_head()(10 * torch.randn(50, 32, generator=seeded(0)))
    assert step.shape == (50, 9)
    assert (step.std(dim=0) > 0).all()


def test_takes_steps_both_ways() -> None:
    step = make_head()(torch.randn(200, 32, generator=seeded(1)))
    assert (step.amin(dim=0) < 0).all()
    assert (step.amax(dim=0) > 0).all()


def test_which_cloud_is_which_matters() -> None:
    source, target = torch.randn(2, 5, 16, generator=seeded(2))
    head = make_head()
    there = head(torch.cat([source, target], dim=-1))
    assert not torch.allclose(there, head(torch.cat([target, source], dim=-1)))
