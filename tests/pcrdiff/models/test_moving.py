"""A description that moves with its cloud."""

import torch
from torch import Tensor

from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.models.moving import MOVING, MovingEmbedding
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded


def embedding() -> MovingEmbedding:
    torch.manual_seed(0)
    return MovingEmbedding(16).double()


def clouds() -> Tensor:
    return lopsided_clouds(2, 120, generator=seeded(1)).double()


def test_moving_the_description_is_describing_the_moved_cloud() -> None:
    describe, T = embedding(), random_poses(2, generator=seeded(2))
    eye = torch.eye(4, dtype=torch.float64).expand(2, 4, 4)
    here, there = describe(clouds()), describe(transform(T, clouds()))
    assert here.moved(eye).shape == (2, 120, MOVING)
    torch.testing.assert_close(here.moved(T), there.moved(eye), atol=1e-9, rtol=0)
    torch.testing.assert_close(here.invariant, there.invariant, atol=1e-9, rtol=0)


def test_a_motion_and_its_inverse_leave_no_trace() -> None:
    here, T = embedding()(clouds()), random_poses(2, generator=seeded(3))
    eye = torch.eye(4, dtype=torch.float64).expand(2, 4, 4)
    torch.testing.assert_close(here.moved(invert(T) @ T), here.moved(eye), atol=1e-9, rtol=0)


def test_points_keep_their_order_and_clouds_their_own_description() -> None:
    describe, order = embedding(), torch.randperm(120, generator=seeded(4))
    here, shuffled = describe(clouds()), describe(clouds()[:, order])
    torch.testing.assert_close(shuffled.invariant, here.invariant[:, order], atol=1e-9, rtol=0)
    alone = describe(clouds()[1:])
    torch.testing.assert_close(alone.invariant, here.invariant[1:], atol=1e-9, rtol=0)


def test_coinciding_points_are_described_by_finite_numbers() -> None:
    cloud = clouds()
    cloud[:, 60:] = cloud[:, :1]
    described = embedding()(cloud)
    assert torch.isfinite(described.invariant).all()
    assert torch.isfinite(described.spreads).all()
