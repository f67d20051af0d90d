"""What is particular to EGST: CB's decoder without a noisy pose, applied twice."""

from dataclasses import replace

import torch
from torch import Tensor

from pcrdiff.methods.egst import EGST
from pcrdiff.methods.pcrdiffusion_cb import LEAST_ALPHA
from tests.pcrdiff.methods.small_methods import make_cb, make_matching
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def test_one_update_of_centred_clouds_matches_as_cb_does_before_its_pose_encoder_has_learnt() -> (
    None
):
    pairs, cb, egst = synthetic_pairs(2, 40, generator=seeded(0)), make_cb(), make_matching(EGST)
    source = pairs.source - pairs.source.mean(dim=1, keepdim=True)
    target = pairs.target - pairs.target.mean(dim=1, keepdim=True)
    for name in ("embedding", "attention", "annealing"):
        getattr(egst, name).load_state_dict(getattr(cb, name).state_dict())
    for parameter in cb.pose_encoder.parameters():
        torch.nn.init.zeros_(parameter)
    encoded = cb.encode(source, target)
    conditioned = cb.condition(torch.randn(2, 7), torch.tensor([3, 4]), encoded)
    conditioned = replace(conditioned, alpha=conditioned.alpha - LEAST_ALPHA)  # EGST has no least
    matches = conditioned.matches(cb.sinkhorn_iterations)
    [(_, found)] = egst.align(source, target, 1)
    torch.testing.assert_close(found, matches, atol=1e-4, rtol=1e-3)


def test_the_clouds_trade_places_in_one_shared_attention() -> None:
    method, seen = make_matching(EGST), list[tuple[Tensor, Tensor]]()
    method.attention.register_forward_pre_hook(lambda _, inputs: seen.append(inputs))
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    method.align(pairs.source, pairs.target, 1)
    (first, other), (second, one) = seen
    assert first is one
    assert other is second
