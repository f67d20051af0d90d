"""What is particular to PointNetLK; the loop itself is tested in models/test_lucas_kanade.py."""

from pathlib import Path

import numpy as np
import pytest
import torch

from pcrdiff.clouds.surface import sample_points
from pcrdiff.datasets.modelnet40 import read_items
from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.pointnetlk import PointNetLK
from pcrdiff.models.losses import pose_loss
from pcrdiff.models.lucas_kanade import align
from pcrdiff.registration import Pairs
from tests.pcrdiff.synthetic_clouds import (
    lopsided_clouds,
    random_poses,
    seeded,
    small_pose,
    synthetic_pairs,
)


def make(train_updates: int = 2, updates: int = 20, feature_dim: int = 64) -> PointNetLK:
    torch.manual_seed(0)
    return PointNetLK(feature_dim, 0.1, train_updates, updates)


def hard_pairs(count: int = 8, n: int = 64) -> Pairs:
    """Under any rotation at all, so that some are out of reach."""
    source = lopsided_clouds(count, n, generator=seeded(0))
    poses = random_poses(count, generator=seeded(1))
    target = transform(poses, source.double()).float().flip(1)
    return Pairs(source, target, poses, torch.arange(count), ("potato",) * count)


@torch.no_grad()
def scale_features(method: PointNetLK, factor: float) -> None:
    last = [layer for layer in method.encoder.per_point if isinstance(layer, torch.nn.Linear)][-1]
    last.weight.mul_(factor)
    last.bias.mul_(factor)


def test_solves_exact_copies_even_untrained() -> None:
    pairs = synthetic_pairs(4, 256, generator=seeded(0))
    answer = make().register(pairs.source, pairs.target, generator=seeded(0)).double()
    assert error_r_deg(answer, pairs.T_target_source).median() < 0.1
    assert error_t(answer, pairs.T_target_source).median() < 1e-3


def test_the_loss_is_that_of_the_pose_after_each_update_of_training() -> None:
    pairs, method = synthetic_pairs(3, 50, generator=seeded(0)), make(train_updates=3, updates=1)
    poses = align(method.encoder, pairs.source, pairs.target, 0.1, 3)
    wanted = sum(pose_loss(T, pairs.T_target_source).item() for T in poses) / 3
    terms = method.loss(pairs, generator=seeded(0))
    assert set(terms) == {"pose"}
    assert terms["pose"].item() == pytest.approx(wanted, rel=1e-5)
    assert terms["pose"].dtype == pairs.source.dtype


def test_registers_with_the_updates_of_its_setting() -> None:
    pairs = hard_pairs()
    answers = [
        make(updates=k).register(pairs.source, pairs.target, generator=seeded(0)) for k in (1, 2)
    ]
    poses = align(make().encoder, pairs.source, pairs.target, 0.1, 2)
    for answer, pose in zip(answers, poses, strict=True):
        torch.testing.assert_close(answer, pose.float())


def test_smaller_features_do_not_lower_the_loss() -> None:
    pairs, method = hard_pairs(), make()
    before = method.loss(pairs, generator=seeded(0))["pose"].item()
    scale_features(method, 0.01)
    after = method.loss(pairs, generator=seeded(0))["pose"].item()
    assert after == pytest.approx(before, rel=1e-3)


def test_features_that_are_all_zero_raise_nothing_and_answer_a_shift() -> None:
    pairs, method = hard_pairs(), make()
    scale_features(method, 0.0)
    answer = method.register(pairs.source, pairs.target, generator=seeded(0))
    shift = pairs.target.mean(dim=1) - pairs.source.mean(dim=1)
    torch.testing.assert_close(answer[:, :3, :3], torch.eye(3).expand(8, 3, 3))
    torch.testing.assert_close(answer[:, :3, 3], shift)


def test_training_makes_the_first_updates_better() -> None:
    pairs, method = hard_pairs(16), make()
    optimizer = torch.optim.Adam(method.parameters(), lr=1e-3)
    losses = []
    for _ in range(25):
        loss = method.loss(pairs, generator=seeded(0))["pose"]
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        losses.append(loss.item())
    assert min(losses[-5:]) < 0.9 * losses[0]


@pytest.mark.real
def test_solves_most_exact_copies_of_real_shapes_even_untrained(real_data: Path) -> None:
    items = [x for x in read_items(real_data / "modelnet10_hdf5_1024") if x.split == "test"][::20]
    samples = [sample_points(x.read(), 512, generator=np.random.default_rng(0)) for x in items]
    source = torch.from_numpy(np.stack(samples)).float()
    turns = torch.linspace(5, 60, len(items)).tolist()
    T = torch.stack([small_pose(turn, (0.4, -0.2, 0.7)) for turn in turns])
    target = transform(T, source.double()).float().flip(1)
    answer = make(feature_dim=256).register(source, target, generator=seeded(0)).double()
    assert error_r_deg(answer, T).median() < 0.1
    assert error_t(answer, T).median() < 1e-3
