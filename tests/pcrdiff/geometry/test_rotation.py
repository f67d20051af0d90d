"""Rotations: round trips everywhere on SO(3), and agreement with SciPy."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from torch import Tensor

from pcrdiff.geometry.rotation import (
    angle_between,
    euler_from_matrix,
    geodesic_angle,
    matrix_from_euler,
    matrix_from_quaternion,
    quaternion_from_matrix,
    vee,
)
from tests.pcrdiff.synthetic_clouds import random_rotations, seeded

BATCHES = [(), (1,), (3, 2)]
AWKWARD_ANGLES = [0.0, 1e-9, 1e-5, 1.0, math.pi - 1e-5, math.pi - 1e-9, math.pi]


def axis_rotation(axis: Tensor, angle: float) -> Tensor:
    """By SciPy, so that it owes nothing to the code under test."""
    unit = (axis / axis.norm()).numpy()
    return torch.from_numpy(Rotation.from_rotvec(unit * angle).as_matrix())


def awkward_rotations() -> Tensor:
    """About the axes, the diagonals and a few crooked axes, by angles where formulas break."""
    axes = [*torch.eye(3), *torch.randn(5, 3, generator=seeded(0)), torch.tensor([1.0, -1.0, 0.0])]
    rotations = [axis_rotation(axis.double(), angle) for axis in axes for angle in AWKWARD_ANGLES]
    return torch.stack(rotations)


@pytest.mark.parametrize("batch", BATCHES)
def test_a_matrix_survives_the_way_through_a_quaternion(batch: tuple[int, ...]) -> None:
    R = random_rotations(*batch, generator=seeded(1))
    q = quaternion_from_matrix(R)
    assert q.shape == (*batch, 4)
    torch.testing.assert_close(matrix_from_quaternion(q), R, atol=1e-14, rtol=0)


def test_a_matrix_survives_it_near_identity_and_near_180_degrees() -> None:
    R = awkward_rotations()
    back = matrix_from_quaternion(quaternion_from_matrix(R))
    torch.testing.assert_close(back, R, atol=1e-14, rtol=0)


def test_a_quaternion_is_a_unit_one_with_positive_w() -> None:
    q = quaternion_from_matrix(awkward_rotations())
    assert (q[..., 0] >= 0).all()
    torch.testing.assert_close(q.norm(dim=-1), torch.ones(len(q), dtype=torch.float64))


def test_quaternions_agree_with_scipy() -> None:
    R = random_rotations(200, generator=seeded(2))
    scipy = Rotation.from_matrix(R.numpy()).as_quat(canonical=True, scalar_first=True)
    torch.testing.assert_close(quaternion_from_matrix(R), torch.from_numpy(scipy))


@given(seed=st.integers(0, 2**32 - 1), length=st.floats(1e-3, 1e3))
def test_the_length_and_the_sign_of_a_quaternion_do_not_matter(seed: int, length: float) -> None:
    q = torch.randn(4, generator=seeded(seed), dtype=torch.float64)
    for same in (length * q, -q):
        torch.testing.assert_close(matrix_from_quaternion(same), matrix_from_quaternion(q))


def test_refuses_a_quaternion_that_names_no_rotation() -> None:
    quaternions = torch.tensor([[1.0, 0, 0, 0], [0, 0, 0, 0]])
    with pytest.raises(ValueError, match="needs non-zero quaternions"):
        matrix_from_quaternion(quaternions)


@pytest.mark.parametrize("batch", BATCHES)
def test_euler_angles_are_scipys_extrinsic_zyx(batch: tuple[int, ...]) -> None:
    angles = torch.rand(*batch, 3, generator=seeded(3), dtype=torch.float64) * 6 - 3
    zyx = angles.flip(-1).reshape(-1, 3).numpy()  # Rx Ry Rz turns about the fixed z first
    scipy = Rotation.from_euler("zyx", zyx).as_matrix().reshape(*batch, 3, 3)
    torch.testing.assert_close(matrix_from_euler(angles), torch.from_numpy(scipy))


def test_euler_angles_are_read_as_scipy_reads_them() -> None:
    R = random_rotations(200, generator=seeded(4))
    scipy = Rotation.from_matrix(R.numpy()).as_euler("zyx")[:, ::-1].copy()
    torch.testing.assert_close(euler_from_matrix(R), torch.from_numpy(scipy))


@pytest.mark.parametrize("batch", BATCHES)
def test_angles_of_the_paper_survive_the_way_through_a_matrix(batch: tuple[int, ...]) -> None:
    angles = torch.rand(*batch, 3, generator=seeded(5), dtype=torch.float64) * math.pi / 4
    torch.testing.assert_close(euler_from_matrix(matrix_from_euler(angles)), angles)


def test_a_matrix_survives_the_way_through_angles_also_at_gimbal_lock() -> None:
    locked = [
        matrix_from_euler(torch.tensor([a, sign * math.pi / 2, 0.3], dtype=torch.float64)).round(
            decimals=16
        )
        for a in (-2.0, 0.0, 0.5)
        for sign in (-1, 1)
    ]
    for R in locked:  # what rounding leaves of cos b says nothing
        R[0, :2] = R[1:, 2] = 0
    R = torch.cat([torch.stack(locked), awkward_rotations()])
    torch.testing.assert_close(matrix_from_euler(euler_from_matrix(R)), R, atol=1e-7, rtol=0)


@pytest.mark.parametrize("angle", AWKWARD_ANGLES)
def test_the_angle_between_rotations_is_the_angle_of_the_turn(angle: float) -> None:
    R = random_rotations(3, 2, generator=seeded(6))
    turned = R @ axis_rotation(torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64), angle)
    measured = geodesic_angle(R, turned)
    assert measured.shape == (3, 2)
    torch.testing.assert_close(measured, torch.full_like(measured, angle), atol=1e-14, rtol=0)


@pytest.mark.parametrize("angle", [1e-9, 1e-12, math.pi - 1e-9, math.pi - 1e-12])
def test_the_smallest_and_largest_angles_are_resolved(angle: float) -> None:
    R = random_rotations(20, generator=seeded(6))
    turned = R @ axis_rotation(torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64), angle)
    torch.testing.assert_close(
        geodesic_angle(R, turned),
        torch.full((20,), angle, dtype=torch.float64),
        atol=2e-15,
        rtol=0,
    )


def test_the_angle_of_a_rotation_with_itself_is_zero_to_the_bit() -> None:
    R = torch.cat([awkward_rotations(), random_rotations(100, generator=seeded(8))])
    assert (geodesic_angle(R, R) == 0).all()


def test_the_angle_is_the_arccosine_where_that_resolves_it() -> None:
    a, b = random_rotations(2, 100, generator=seeded(7))
    arccosine = torch.arccos((torch.einsum("nij,nij->n", a, b) - 1) / 2)
    torch.testing.assert_close(geodesic_angle(a, b), arccosine, atol=1e-12, rtol=0)


def test_the_vector_of_a_rotation_is_its_axis_times_twice_the_sine() -> None:
    axis = torch.tensor([2.0, -1.0, 2.0], dtype=torch.float64)
    for angle in (1e-9, 0.3, 3.0):
        expected = 2 * math.sin(angle) * axis / 3
        torch.testing.assert_close(vee(axis_rotation(axis, angle)), expected, atol=1e-15, rtol=0)


def test_the_angle_between_rotations_is_symmetric_and_never_nan() -> None:
    R = awkward_rotations()
    a, b = R.repeat_interleave(len(R), dim=0), R.repeat(len(R), 1, 1)
    assert torch.isfinite(geodesic_angle(a, b)).all()
    torch.testing.assert_close(geodesic_angle(a, b), geodesic_angle(b, a), atol=0, rtol=0)


def test_the_angle_between_rotations_agrees_with_scipy() -> None:
    a, b = random_rotations(2, 100, generator=seeded(7))
    scipy = (Rotation.from_matrix(a.numpy()).inv() * Rotation.from_matrix(b.numpy())).magnitude()
    np.testing.assert_allclose(geodesic_angle(a, b).numpy(), scipy, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1.0, torch.pi / 2, torch.pi - 1e-7, torch.pi])
def test_an_angle_between_vectors_is_accurate_everywhere(angle: float) -> None:
    angles = torch.tensor(angle, dtype=torch.float64)
    a = torch.tensor([3.0, 0, 0], dtype=torch.float64)
    b = 0.1 * torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)])
    torch.testing.assert_close(angle_between(a, b), angles, atol=1e-14, rtol=0)


def test_an_angle_with_nothing_is_zero() -> None:
    assert angle_between(torch.ones(3), torch.zeros(3)) == 0
