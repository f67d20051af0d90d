"""(i) Training steps a second, beside the same network in plain PyTorch."""

from collections.abc import Callable, Sequence

import torch
from torch import nn

from benchmarks.effort import Effort
from benchmarks.inputs import make_pairs, read_paper_params
from benchmarks.measuring import Comparison, alternate
from benchmarks.plain import Losses, PlainCB, PlainCF
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.registration import Pairs
from pipeline.building import build_untrained
from pipeline.params import Params
from pipeline.training import VALIDATION_WALK

WARM_UP = 2
CLIP = 10.0


def measure_training(params: Params, effort: Effort) -> list[Comparison]:
    """A step of CF and one of CB, with the paper's networks, both sides in turn."""
    paper = read_paper_params()
    walk = paper.diffusion.model_copy(update=VALIDATION_WALK)
    torch.manual_seed(params.seed)
    cf = build_untrained("pcrdiffusion_cf", paper.methods, walk)
    cb = build_untrained("pcrdiffusion_cb", paper.methods, walk)
    if not isinstance(cf, PCRDiffusionCF) or not isinstance(cb, PCRDiffusionCB):
        raise TypeError(f"training is measured of CF and CB, got {type(cf)} and {type(cb)}")
    cf_pairs, cb_pairs = (
        make_pairs(params, points, count)["train"]
        for count, points in (effort.cf_step, effort.cb_step)
    )
    return [
        compare_steps("cf_train_step_vs_plain", (cf.loss, cf), plain_of(PlainCF(cf)), cf_pairs, effort),
        compare_steps("cb_train_step_vs_plain", (cb.loss, cb), plain_of(PlainCB(cb)), cb_pairs, effort),
    ]  # fmt: skip


Trainable = tuple[Callable[..., Losses], nn.Module]
"""A loss, and whose parameters it is of."""


def plain_of(model: PlainCF | PlainCB) -> Trainable:
    """The reference as something to train."""
    return model.loss, model


def compare_steps(
    name: str, ours: Trainable, plain: Trainable, pairs: Pairs, effort: Effort
) -> Comparison:
    """Steps a second of both, on the same pairs, in turn."""
    adam = torch.optim.Adam
    calls = [
        stepper(ours, adam(ours[1].parameters(), lr=1e-3, fused=True), pairs),
        stepper(plain, adam(plain[1].parameters(), lr=1e-3), pairs),
    ]
    seconds = alternate(calls, effort.repeats, WARM_UP)
    rates: Sequence[Sequence[float]] = [[1 / s for s in each] for each in seconds]
    return Comparison(name, rates[0], rates[1], "steps/s", higher_is_better=True)


def stepper(
    trainable: Trainable, optimizer: torch.optim.Optimizer, pairs: Pairs
) -> Callable[[], None]:
    """A whole step: loss, gradients, clipping, Adam; each with noise of its own."""
    loss, model = trainable
    generator = torch.Generator().manual_seed(0)

    def step() -> None:
        total = torch.stack(list(loss(pairs, generator=generator).values())).sum()
        optimizer.zero_grad()
        torch.autograd.backward(total)
        nn.utils.clip_grad_norm_(model.parameters(), CLIP, error_if_nonfinite=True)
        optimizer.step()

    return step
