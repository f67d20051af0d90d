"""Fewer points of a training pair: copies stay copies, and what has no counterpart keeps none."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.neighbors import nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.registration import Pairs
from pcrdiff.training.thinning import thin
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def generators(pairs: Pairs, seed: int = 0) -> list[np.random.Generator]:
    return [np.random.default_rng([seed, k]) for k in range(len(pairs))]


def off(pairs: Pairs) -> Tensor:
    """From each target point to the nearest of the source, as the true pose lays it."""
    moved = transform(pairs.T_target_source, pairs.source.double()).float()
    return nearest(pairs.target, moved, 1)[0].sqrt()


def test_exact_copies_stay_exact_copies_in_an_order_of_their_own() -> None:
    pairs = synthetic_pairs(3, 80, generator=seeded(0))
    few = thin(pairs, 30, generators(pairs))
    assert few.source.shape == few.target.shape == (3, 30, 3)
    assert off(few).max() < 1e-5
    moved = transform(few.T_target_source, few.source.double()).float()
    assert (moved - few.target).norm(dim=-1).max() > 0.1


def test_points_without_a_counterpart_are_kept_in_part() -> None:
    pairs = synthetic_pairs(2, 100, generator=seeded(1))
    moved = transform(pairs.T_target_source, pairs.source.double()).float()
    half = replace(pairs, source=pairs.source[:, :70], target=moved[:, 30:])
    few = thin(half, 50, generators(pairs))
    alone = (off(half)[..., 0] > 1e-4).sum(dim=1), (off(few)[..., 0] > 1e-4).sum(dim=1)
    assert (alone[0] == 30).all()
    assert ((alone[1] > 10) & (alone[1] < 35)).all()


def test_another_generator_keeps_other_points_and_the_same_one_the_same() -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(2))
    first, again, other = (thin(pairs, 20, generators(pairs, seed)) for seed in (0, 0, 1))
    assert torch.equal(first.source, again.source)
    assert torch.equal(first.target, again.target)
    assert not torch.equal(first.source, other.source)


@pytest.mark.parametrize("count", [60, 900])
def test_a_cloud_of_fewer_points_is_left_as_it_is(count: int) -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(2))
    assert thin(pairs, count, generators(pairs)) is pairs


def test_clouds_of_unequal_size_keep_at_most_as_many() -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(2))
    uneven = replace(pairs, source=pairs.source[:, :20])
    few = thin(uneven, 40, generators(pairs))
    assert (few.source.shape[1], few.target.shape[1]) == (20, 40)
