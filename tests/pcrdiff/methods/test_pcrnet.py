"""What is particular to PCRNet: a pose put together from updates, and no use of the truth."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.rigid import from_parts, invert, pose_vector, transform
from pcrdiff.methods.pcrnet import PCRNet
from pcrdiff.models.losses import nearest_distance
from pcrdiff.registration import Pairs
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose, synthetic_pairs


def make_method(updates: int = 3, train_updates: int = 2, probes: int = 1000) -> PCRNet:
    torch.manual_seed(0)
    return PCRNet(feature_dim=16, train_updates=train_updates, probes=probes, updates=updates)


class Told(PCRNet):
    """Takes the steps it was told, and remembers the clouds it was shown."""

    def __init__(self, steps: Tensor) -> None:
        super().__init__(feature_dim=16, train_updates=len(steps), probes=1000, updates=len(steps))
        self.steps, self.shown = iter(steps), list[Tensor]()
        self.encoder.register_forward_pre_hook(lambda _, inputs: self.shown.append(inputs[0]))
        identity = pose_vector(torch.eye(4))
        self.head.register_forward_hook(lambda *_: pose_vector(next(self.steps)).float() - identity)


def test_the_pose_is_put_together_from_the_steps_about_the_means() -> None:
    pairs, steps = (
        synthetic_pairs(2, 40, generator=seeded(0)),
        random_poses(3, 2, generator=seeded(1)),
    )
    answer = Told(steps).register(pairs.source, pairs.target, generator=seeded(0)).double()
    source = pairs.source.double()
    moved = source - source.mean(dim=1, keepdim=True)
    for step in steps:  # R <- R_i R, t <- R_i t + t_i
        moved = transform(step, moved)
    moved = moved + pairs.target.double().mean(dim=1, keepdim=True)
    torch.testing.assert_close(transform(answer, source), moved, atol=1e-5, rtol=0)


def test_shows_the_target_once_and_the_source_where_the_last_step_has_moved_it() -> None:
    pairs, steps = (
        synthetic_pairs(2, 40, generator=seeded(0)),
        random_poses(3, 2, generator=seeded(1)),
    )
    method = Told(steps)
    method.register(pairs.source, pairs.target, generator=seeded(0))
    target = pairs.target - pairs.target.mean(dim=1, keepdim=True)
    moved = pairs.source - pairs.source.mean(dim=1, keepdim=True)
    shown = [target, moved]
    for step in steps[:-1]:
        moved = transform(step.float(), moved)
        shown.append(moved)
    torch.testing.assert_close(method.shown, shown, atol=1e-5, rtol=0)


def test_the_answer_follows_any_shift_of_either_cloud() -> None:
    pairs, method = synthetic_pairs(2, 40, generator=seeded(0)), make_method().double()
    source, target = pairs.source.double(), pairs.target.double()
    shifts = torch.randn(2, 2, 3, generator=seeded(1), dtype=torch.float64)
    A, B = (from_parts(torch.eye(3).double().expand(2, 3, 3), shift) for shift in shifts)
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(transform(A, source), transform(B, target), generator=seeded(0))
    torch.testing.assert_close(moved, B @ answer @ invert(A), atol=1e-10, rtol=0)


def test_the_answer_is_as_rigid_after_many_updates() -> None:
    pairs = synthetic_pairs(4, 40, generator=seeded(0))
    R = make_method(updates=50).register(pairs.source, pairs.target, generator=seeded(0))[:, :3, :3]
    eye = torch.eye(3, dtype=torch.float64).expand(4, 3, 3)
    torch.testing.assert_close(R.double() @ R.double().mT, eye, atol=5e-7, rtol=0)


def mean_distance(a: Tensor, b: Tensor) -> float:
    """Half of both ways' mean distance to the nearest point, one pair at a time."""
    gaps = [torch.cdist(p.double(), q.double()) for p, q in zip(a, b, strict=True)]
    ways = [(gap.amin(dim=0).mean() + gap.amin(dim=1).mean()) / 2 for gap in gaps]
    return torch.stack(ways).mean().item()


def test_the_loss_is_the_distance_after_each_step() -> None:
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    steps = torch.stack([small_pose(30, (0.1, 0, 0)), small_pose(-10, (0, 0.2, 0))])
    steps = steps.unsqueeze(1).expand(2, 2, 4, 4)
    terms = Told(steps).loss(pairs, generator=seeded(0))
    target = pairs.target - pairs.target.mean(dim=1, keepdim=True)
    moved = pairs.source - pairs.source.mean(dim=1, keepdim=True)
    first = transform(steps[0].float(), moved)
    second = transform(steps[1].float(), first)
    expected = (mean_distance(first, target) + mean_distance(second, target)) / 2
    assert terms["distance"].item() == pytest.approx(expected, rel=1e-4)
    assert set(terms) == {"distance"}


def test_the_loss_does_not_look_at_the_truth() -> None:
    pairs, method = synthetic_pairs(2, 40, generator=seeded(0)), make_method()
    other = random_poses(2, generator=seeded(1))
    lied = Pairs(pairs.source, pairs.target, other, pairs.item, pairs.group)
    assert method.loss(lied, generator=seeded(0)) == method.loss(pairs, generator=seeded(0))


def test_probes_are_drawn_from_the_generator_and_ask_for_the_whole_on_average() -> None:
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    whole = make_method().loss(pairs, generator=seeded(0))["distance"].item()
    few, g = make_method(probes=10), seeded(1)
    drawn = [few.loss(pairs, generator=g)["distance"].item() for _ in range(100)]
    assert len(set(drawn)) > 90
    assert sum(drawn) / len(drawn) == pytest.approx(whole, rel=0.02)
    assert few.loss(pairs, generator=seeded(1))["distance"].item() == drawn[0]


def test_a_step_is_trained_from_where_it_starts_and_not_through_the_steps_before() -> None:
    pairs, method = synthetic_pairs(2, 40, generator=seeded(0)), make_method(train_updates=2)
    parameters = list(method.parameters())
    ours = torch.autograd.grad(method.loss(pairs, generator=seeded(0))["distance"], parameters)
    source, target = (cloud - cloud.mean(1, keepdim=True) for cloud in (pairs.source, pairs.target))
    gradients = {}
    for through in (False, True):
        T, terms = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1), []
        for _ in range(2):
            T = method.update(T if through else T.detach(), source, method.encoder(target))
            moved = transform(T.float(), source)
            terms += [nearest_distance(moved, target), nearest_distance(target, moved)]
        gradients[through] = torch.autograd.grad(torch.stack(terms).mean(), parameters)
    torch.testing.assert_close(ours, gradients[False], atol=1e-6, rtol=1e-3)
    pairs_of = zip(ours, gradients[True], strict=True)
    assert any((a - b).abs().max() > 1e-3 for a, b in pairs_of)


def test_learns_to_turn_one_cloud() -> None:
    pairs = synthetic_pairs(4, 60, generator=seeded(0))
    method = make_method(train_updates=2, probes=30)
    optimizer = torch.optim.Adam(method.parameters(), lr=1e-3)
    g, losses = seeded(1), list[float]()
    for _ in range(30):
        loss = method.loss(pairs, generator=g)["distance"]
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        losses.append(loss.item())
    assert sum(losses[-5:]) < 0.5 * sum(losses[:5])


def test_a_fresh_network_moves_little() -> None:
    pairs = synthetic_pairs(4, 40, generator=seeded(0))
    answer = make_method(updates=1).register(pairs.source, pairs.source, generator=seeded(0))
    eye = torch.eye(4, dtype=torch.float64).expand(4, 4, 4)
    assert error_r_deg(answer.double(), eye).max() < 15


def test_the_distance_of_clouds_that_coincide_has_a_finite_gradient() -> None:
    cloud = synthetic_pairs(2, 40, generator=seeded(0)).source.requires_grad_()
    distance = nearest_distance(cloud, cloud.detach())
    (gradient,) = torch.autograd.grad(distance, cloud)
    assert distance < 2e-4
    assert torch.isfinite(gradient).all()
