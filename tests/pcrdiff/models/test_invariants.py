"""Features that no rotation changes."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from pcrdiff.geometry.rigid import transform
from pcrdiff.models.invariants import describe_invariantly
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded


def lattice() -> Tensor:
    """Points with many equally far neighbours, and one that takes the mean aside; ``[1 n 3]``."""
    grid = 0.1 * torch.cartesian_prod(torch.arange(5.0), torch.arange(4.0), torch.arange(3.0))
    return torch.cat([grid, torch.tensor([[0.93, 0.31, 0.57]])]).double().unsqueeze(0)


@given(seed=st.integers(0, 2**32 - 1))
def test_features_follow_their_points_through_any_motion_and_order(seed: int) -> None:
    g = seeded(seed)
    cloud = lopsided_clouds(2, 60, generator=g).double()
    order = torch.randperm(60, generator=g)
    moved = transform(random_poses(2, generator=g), cloud)[:, order]
    features = describe_invariantly(cloud, 7)[:, order]
    torch.testing.assert_close(describe_invariantly(moved, 7), features, atol=1e-6, rtol=0)


@pytest.mark.parametrize("k", [3, 5, 8])
def test_features_follow_their_points_where_neighbours_are_equally_far(k: int) -> None:
    cloud, g = lattice(), seeded(0)
    order = torch.randperm(cloud.shape[1], generator=g)
    moved = transform(random_poses(1, generator=g), cloud)[:, order]
    features = describe_invariantly(cloud, k)[:, order]
    torch.testing.assert_close(describe_invariantly(moved, k), features, atol=1e-6, rtol=0)


def test_the_features_worked_by_hand() -> None:
    points = [[2.0, 0, 0], [2, 1, 0], [2, 0, -1], [-6, -1, 1]]  # about their mean
    features = describe_invariantly(torch.tensor([points], dtype=torch.float64), 2)[0, 0]
    side = math.atan2(1, 2)
    quarter = [math.pi / 2, 3 * math.pi / 2]
    expected = torch.tensor([2, 5**0.5, 5**0.5, side, side, *quarter], dtype=torch.float64)
    torch.testing.assert_close(features, expected)


def test_the_gaps_around_a_point_make_a_full_turn() -> None:
    gaps = describe_invariantly(lopsided_clouds(2, 60, generator=seeded(0)), 7)[..., -7:]
    assert (gaps >= 0).all()
    torch.testing.assert_close(gaps.sum(dim=-1), torch.full((2, 60), 2 * math.pi))


def test_features_need_more_points_than_neighbours() -> None:
    with pytest.raises(ValueError, match="at least k = 8 points, got 7"):
        describe_invariantly(torch.rand(1, 7, 3), 7)
