"""Layers that neither shrink nor swell a signal at the start."""

import pytest
import torch
from torch import nn

from pcrdiff.models.mlp import he_layers, he_linear
from tests.pcrdiff.made_up_clouds import seeded


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
