"""Rigid transforms: the laws of a group, and the way through the 7-vector."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcrdiff.geometry.rigid import (
    centred,
    centroid_shift,
    check_pose,
    from_parts,
    from_pose_vector,
    invert,
    pose_vector,
    transform,
)
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose

BATCHES = [(), (1,), (3, 2)]


@pytest.mark.parametrize("batch", BATCHES)
def test_a_transform_turns_and_then_shifts(batch: tuple[int, ...]) -> None:
    T = random_poses(*batch, generator=seeded(0))
    points = torch.randn(*batch, 5, 3, generator=seeded(1), dtype=torch.float64)
    homogeneous = torch.cat([points, torch.ones_like(points[..., :1])], dim=-1)
    torch.testing.assert_close(transform(T, points), (homogeneous @ T.mT)[..., :3])


def test_a_quarter_turn_about_z_worked_by_hand() -> None:
    R = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    T = from_parts(R, torch.tensor([10.0, 20, 30]))
    moved = transform(T, torch.tensor([[1.0, 2, 3]]))
    torch.testing.assert_close(moved, torch.tensor([[8.0, 21, 33]]))


@pytest.mark.parametrize("batch", BATCHES)
def test_an_inverse_undoes(batch: tuple[int, ...]) -> None:
    T = random_poses(*batch, generator=seeded(2))
    eye = torch.eye(4, dtype=torch.float64).expand(*batch, 4, 4)
    torch.testing.assert_close(invert(T) @ T, eye, atol=1e-14, rtol=0)
    torch.testing.assert_close(T @ invert(T), eye, atol=1e-14, rtol=0)
    torch.testing.assert_close(invert(invert(T)), T)


@given(seed=st.integers(0, 2**32 - 1))
def test_moving_twice_is_moving_by_the_product(seed: int) -> None:
    T_b_a, T_c_b = random_poses(2, generator=seeded(seed))
    points = torch.randn(7, 3, generator=seeded(seed), dtype=torch.float64)
    torch.testing.assert_close(
        transform(T_c_b @ T_b_a, points), transform(T_c_b, transform(T_b_a, points))
    )


@pytest.mark.parametrize("batch", BATCHES)
def test_a_pose_survives_the_way_through_its_vector(batch: tuple[int, ...]) -> None:
    T = random_poses(*batch, generator=seeded(3))
    vector = pose_vector(T)
    assert vector.shape == (*batch, 7)
    torch.testing.assert_close(from_pose_vector(vector), T, atol=1e-14, rtol=0)


@pytest.mark.parametrize("angle_deg", [0.0, 1e-7, 1e-3, 179.999, 180 - 1e-7, 180.0])
def test_it_survives_near_identity_and_near_180_degrees(angle_deg: float) -> None:
    T = small_pose(angle_deg, (1.0, -2.0, 3.0))
    torch.testing.assert_close(from_pose_vector(pose_vector(T)), T, atol=1e-14, rtol=0)


def test_the_vector_of_a_half_turn_about_x_worked_by_hand() -> None:
    T = from_parts(torch.diag(torch.tensor([1.0, -1, -1])), torch.tensor([4.0, 5, 6]))
    torch.testing.assert_close(pose_vector(T), torch.tensor([0.0, 1, 0, 0, 4, 5, 6]))


def test_the_vector_of_60_degrees_has_the_cosine_of_30_first() -> None:
    vector = pose_vector(small_pose(60.0, (0.0, 0.0, 0.0)))
    expected = [math.cos(math.pi / 6), 1 / 6, 1 / 3, 1 / 3, 0, 0, 0]
    torch.testing.assert_close(vector, torch.tensor(expected, dtype=torch.float64))


def test_any_nonzero_quaternion_gives_a_rigid_pose() -> None:
    T = from_pose_vector(torch.randn(50, 7, generator=seeded(4), dtype=torch.float64))
    R = T[:, :3, :3]
    torch.testing.assert_close(R @ R.mT, torch.eye(3, dtype=torch.float64).expand_as(R))
    torch.testing.assert_close(torch.det(R), torch.ones(50, dtype=torch.float64))
    assert (T[:, 3] == torch.tensor([0.0, 0, 0, 1])).all()


def test_refuses_a_vector_whose_quaternion_is_zero() -> None:
    with pytest.raises(ValueError, match="needs non-zero quaternions"):
        from_pose_vector(torch.tensor([[0.0, 0, 0, 0, 1, 2, 3]]))


def test_gradients_pass_through_the_way_back_and_forth() -> None:
    vector = pose_vector(random_poses(3, generator=seeded(5))).requires_grad_()
    assert torch.autograd.gradcheck(lambda v: pose_vector(from_pose_vector(v)), vector)


def test_the_shift_between_the_centroids_turns_nothing() -> None:
    source, target = torch.randn(2, 9, 3, generator=seeded(3))
    shift = centroid_shift(source, target[:7])
    assert torch.equal(shift[:3, :3], torch.eye(3).double())
    moved = transform(shift, source.double()).mean(dim=0)
    torch.testing.assert_close(moved, target[:7].double().mean(dim=0), atol=1e-6, rtol=0)


def test_a_centred_cloud_is_carried_back_by_its_pose() -> None:
    points = torch.randn(9, 3, generator=seeded(3)) + 5
    p, T = centred(points)
    torch.testing.assert_close(p.mean(dim=0), torch.zeros(3).double(), atol=1e-12, rtol=0)
    torch.testing.assert_close(transform(T, p), points.double())


POSE = small_pose(20, (0.1, 0.2, 0.3)).numpy()


@pytest.mark.parametrize(
    "broken",
    [
        np.full((4, 4), np.nan),
        np.where(np.eye(4) == 1, POSE, np.inf),
        POSE @ np.diag([1.0, 1.0, -1.0, 1.0]),
        POSE @ np.diag([1.1, 1.0, 1.0, 1.0]),
        np.zeros((4, 4)),
        np.vstack([POSE[:3], [[0.0, 0.0, 0.1, 1.0]]]),
    ],
    ids=["nan", "infinite", "reflection", "stretched", "zeros", "projective"],
)
def test_what_is_no_rigid_pose_is_refused(broken: np.ndarray) -> None:
    assert (check_pose("x", POSE).numpy() == POSE).all()
    with pytest.raises(ValueError, match=r"^x needs a rigid pose from its library, got \[\["):
        check_pose("x", broken)
