"""What is particular to DCP's second version: the transformer between the clouds."""

import torch
from torch import Tensor

from pcrdiff.methods.dcp_v1 import DCPv1
from pcrdiff.methods.dcp_v2 import DCPv2, Transformer
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def make() -> DCPv2:
    torch.manual_seed(0)
    return DCPv2(feature_dim=32, neighbours=6)


def features() -> tuple[Tensor, Tensor]:
    g = seeded(1)
    return torch.randn(2, 12, 16, generator=g), torch.randn(2, 9, 16, generator=g)


def test_a_transformer_that_says_nothing_leaves_the_first_version() -> None:
    method, first = make(), DCPv1(feature_dim=32, neighbours=6)
    first.encoder.load_state_dict(method.encoder.state_dict())
    pairs = synthetic_pairs(2, 30, generator=seeded(0))
    clouds = pairs.source, pairs.target
    spoken = method.register(*clouds, generator=seeded(0))
    torch.nn.init.zeros_(method.transformer.norm_decoder.weight)
    silent = method.register(*clouds, generator=seeded(0))
    torch.testing.assert_close(silent, first.register(*clouds, generator=seeded(0)))
    assert not torch.allclose(spoken, silent, atol=1e-4)


def test_the_clouds_trade_places_in_one_shared_transformer() -> None:
    method, heard = make(), list[tuple[Tensor, Tensor]]()
    method.transformer.register_forward_pre_hook(lambda _, inputs: heard.append(inputs))
    pairs = synthetic_pairs(2, 30, generator=seeded(0))
    method.register(pairs.source, pairs.target, generator=seeded(0))
    (first, other), (second, one) = heard
    assert first is one
    assert other is second
    torch.testing.assert_close(first, method.encoder(pairs.source))


def test_the_transformer_follows_the_order_of_its_points_and_forgets_that_of_the_other() -> None:
    torch.manual_seed(0)
    net, (own, other) = Transformer(16), features()
    told = net(own, other)
    assert told.shape == own.shape
    torch.testing.assert_close(net(own.flip(1), other), told.flip(1))
    torch.testing.assert_close(net(own, other.flip(1)), told)


def test_the_transformer_hears_every_point_of_both_clouds() -> None:
    torch.manual_seed(0)
    net, (own, other) = Transformer(16), features()
    own.requires_grad_()
    other.requires_grad_()
    torch.autograd.backward(net(own, other)[:, 0].square().sum())
    for cloud in (own, other):
        assert cloud.grad is not None
        assert (cloud.grad.abs().amax(dim=-1) > 0).all()


def test_training_and_evaluation_give_the_same_answer() -> None:
    method, pairs = make(), synthetic_pairs(2, 30, generator=seeded(0))
    training = method.train().register(pairs.source, pairs.target, generator=seeded(0))
    evaluated = method.eval().register(pairs.source, pairs.target, generator=seeded(0))
    torch.testing.assert_close(evaluated, training, atol=1e-5, rtol=0)
