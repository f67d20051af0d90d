"""(i) Training steps a second, beside the same network in plain PyTorch."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection

import torch
from torch import nn

from benchmarks.effort import Effort
from benchmarks.inputs import make_pairs, read_paper_params
from benchmarks.measuring import Comparison, alternate
from benchmarks.plain import Losses, PlainCB, PlainCF
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.registration import Pairs
from pipeline.loading import build_untrained
from pipeline.settings.params import Params
from stages.train import VALIDATION_WALK

WARM_UP = 2
CLIP = 10.0


def measure_training(params: Params, effort: Effort) -> list[Comparison]:
    """A step of CF and one of CB, with the paper's networks, both sides in turn.

    The reference trains in a process of its own, which is given the number of threads and nothing
    else: the allocator and denormal numbers are as PyTorch finds them. A second row of each
    measures it in this process, where they are as this project's stages have them.
    """
    paper, found = read_paper_params(), []
    for name, (count, points) in (("cf", effort.cf_step), ("cb", effort.cb_step)):
        pairs = make_pairs(params, points, count)["train"]
        ours, plain = steppers(name, paper, pairs)
        with elsewhere(name, paper, pairs) as step:
            seconds = alternate([ours, step, plain], effort.repeats, WARM_UP)
        found += [
            rates(f"{name}_train_step_vs_plain", seconds[0], seconds[1]),
            rates(f"{name}_train_step_vs_plain_settled", seconds[0], seconds[2]),
        ]
    return found


def rates(name: str, ours: Sequence[float], peer: Sequence[float]) -> Comparison:
    """Steps a second, from the seconds of each."""
    each = [[1 / s for s in side] for side in (ours, peer)]
    return Comparison(name, each[0], each[1], "steps/s", higher_is_better=True)


def steppers(
    name: str, paper: Params, pairs: Pairs
) -> tuple[Callable[[], None], Callable[[], None]]:
    """A whole training step of a method of ours, and of the same network in plain PyTorch."""
    walk = paper.diffusion.model_copy(update=VALIDATION_WALK)
    torch.manual_seed(paper.seed)
    method = build_untrained(f"pcrdiffusion_{name}", paper.methods, walk)
    if isinstance(method, PCRDiffusionCF):
        plain: PlainCF | PlainCB = PlainCF(method)
    elif isinstance(method, PCRDiffusionCB):
        plain = PlainCB(method)
    else:
        raise TypeError(f"training is measured of CF and CB, got {type(method)}")
    adam = torch.optim.Adam
    return (
        stepper((method.loss, method), adam(method.parameters(), lr=1e-3, fused=True), pairs),
        stepper((plain.loss, plain), adam(plain.parameters(), lr=1e-3), pairs),
    )


@contextmanager
def elsewhere(name: str, paper: Params, pairs: Pairs) -> Iterator[Callable[[], None]]:
    """The plain network in a new process, which steps when it is asked to; the first step waits.

    Raises:
        EOFError: The process has ended, in a step.
    """
    context = get_context("spawn")
    pipe, theirs = context.Pipe()
    given = (theirs, name, paper.model_dump(), pairs, torch.get_num_threads())
    process = context.Process(target=serve, args=given)
    process.start()
    theirs.close()

    def step() -> None:
        pipe.send(None)
        pipe.recv()

    try:
        yield step
    finally:
        pipe.close()
        process.join()


def serve(
    pipe: Connection, name: str, paper: Mapping[str, object], pairs: Pairs, threads: int
) -> None:
    """Step as often as the other end asks, until it hangs up."""
    torch.set_num_threads(threads)
    _, plain = steppers(name, Params.model_validate(paper), pairs)
    with suppress(EOFError):
        while True:
            pipe.recv()
            pipe.send(plain())


Trainable = tuple[Callable[..., Losses], nn.Module]
"""A loss, and whose parameters it is of."""


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
