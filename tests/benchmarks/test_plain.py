"""The plain reference is the same function: what is measured is the way it is computed."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from benchmarks.plain import PlainCB, PlainCF
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.registration import LearnedMethod, Pairs

WALK = Walk(timesteps=50, steps=1, sampler="ddpm", hypotheses=1)


def make_cf() -> PCRDiffusionCF:
    return PCRDiffusionCF(WALK, 64, "quaternion", "raw", "source", "with")


def make_cb() -> PCRDiffusionCB:
    return PCRDiffusionCB(WALK, 16, 8, 0.5, 5, "quaternion", "raw", "with")


def make_pairs(count: int, points: int, dtype: torch.dtype) -> Pairs:
    """Clouds on ellipsoids, where normals are plain to see."""
    generator = torch.Generator().manual_seed(3)
    source = nn.functional.normalize(torch.randn(count, points, 3, generator=generator), dim=-1)
    source = (source * torch.tensor([1.0, 0.7, 0.4])).to(dtype)
    poses = np.stack(
        [draw_pose(PoseRange(0.8, 1.0), generator=np.random.default_rng(k)) for k in range(count)]
    )
    T = torch.from_numpy(poses)
    order = torch.randperm(points, generator=generator)
    target = transform(T.to(dtype), source)[:, order]
    return Pairs(source, target, T, torch.arange(count), ("shape",) * count)


def stir(method: nn.Module) -> None:
    """Move every weight off its start, zeros too, so that each has a gradient to compare."""
    generator = torch.Generator().manual_seed(5)
    with torch.no_grad():
        for weight in method.parameters():
            weight.add_(0.05 * torch.randn(weight.shape, generator=generator).to(weight))


def loss_and_gradients(
    model: PlainCF | PlainCB | LearnedMethod, pairs: Pairs
) -> tuple[dict[str, Tensor], list[Tensor]]:
    terms = dict(model.loss(pairs, generator=torch.Generator().manual_seed(1)))
    gradients = torch.autograd.grad(torch.stack(list(terms.values())).sum(), [*model.parameters()])
    return {name: value.detach() for name, value in terms.items()}, [*gradients]


CASES = [
    (make_cf, PlainCF, torch.float64, 1e-9),
    (make_cf, PlainCF, torch.float32, 1e-5),
    (make_cb, PlainCB, torch.float64, 1e-9),
    (make_cb, PlainCB, torch.float32, 2e-3),  # a normal is known to four digits in float32
]


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize(("make", "plain", "dtype", "tolerance"), CASES)
def test_the_reference_has_the_losses_and_gradients_of_the_method(
    make: Callable[[], PCRDiffusionCF | PCRDiffusionCB],
    plain: Callable[[LearnedMethod], PlainCF | PlainCB],
    dtype: torch.dtype,
    tolerance: float,
) -> None:
    torch.manual_seed(0)
    method = make().to(dtype)
    stir(method)
    reference = plain(method)
    pairs = make_pairs(3, 64, dtype)
    ours, our_gradients = loss_and_gradients(method, pairs)
    theirs, their_gradients = loss_and_gradients(reference, pairs)
    assert ours.keys() == theirs.keys()
    for name, value in ours.items():
        torch.testing.assert_close(theirs[name], value, rtol=tolerance, atol=0.0)
    whole = torch.cat([g.flatten() for g in our_gradients])
    difference = torch.cat([g.flatten() for g in their_gradients]) - whole
    assert all(g.abs().max() > 0 for g in our_gradients)
    assert difference.norm() <= tolerance * whole.norm()


def test_the_reference_has_weights_of_its_own() -> None:
    method = make_cf()
    reference = PlainCF(method)
    stir(reference)
    same = zip(method.parameters(), reference.parameters(), strict=True)
    assert not any(torch.equal(a, b) for a, b in same)
