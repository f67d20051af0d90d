"""The metrics: hand-worked values, and never NaN."""

import pytest
import torch
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.metrics import (
    chamfer_ratio,
    error_r_deg,
    error_t,
    euler_difference_deg,
    is_right,
    modified_chamfer,
    translation_difference,
)
from pcrdiff.geometry.rigid import from_parts, transform
from tests.pcrdiff.synthetic_clouds import random_poses, seeded


def about_x(angle_deg: float, t: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> torch.Tensor:
    R = torch.from_numpy(Rotation.from_euler("x", angle_deg, degrees=True).as_matrix())
    return from_parts(R, torch.tensor(t, dtype=torch.float64)).unsqueeze(0)


@pytest.mark.parametrize(
    ("angle_deg", "shift", "right"),
    [(4.9, 0.099, True), (5.1, 0.0, False), (0.0, 0.101, False), (-4.9, -0.099, True)],
)
def test_right_is_what_is_off_by_less_than_five_degrees_and_a_tenth(
    angle_deg: float, shift: float, right: bool
) -> None:
    truth = about_x(170, (3.0, -1.0, 0.2))
    estimate = about_x(170 + angle_deg, (3.0, -1.0 + shift, 0.2))
    assert is_right(estimate, truth).tolist() == [right]


def test_ten_degrees_about_x_and_a_shift_of_one_half() -> None:
    estimate, truth = about_x(10, (0.3, 0.0, 0.4)), about_x(0)
    assert error_r_deg(estimate, truth).item() == pytest.approx(10)
    assert error_t(estimate, truth).item() == pytest.approx(0.5)
    expected = torch.tensor([[10.0, 0, 0]], dtype=torch.float64)
    torch.testing.assert_close(euler_difference_deg(estimate, truth), expected)
    expected = torch.tensor([[0.3, 0, 0.4]], dtype=torch.float64)
    torch.testing.assert_close(translation_difference(estimate, truth), expected)


def test_differences_are_estimate_minus_truth_axis_by_axis() -> None:
    estimate, truth = about_x(20, (1.0, 2.0, 3.0)), about_x(50, (1.0, 0.0, 5.0))
    assert euler_difference_deg(estimate, truth)[0, 0].item() == pytest.approx(-30)
    assert translation_difference(estimate, truth).tolist() == [[0.0, 2.0, -2.0]]


def test_euler_differences_are_scipys_extrinsic_zyx() -> None:
    estimate, truth = random_poses(2, 50, generator=seeded(0))
    zyx = [
        Rotation.from_matrix(T[:, :3, :3].numpy()).as_euler("zyx", True) for T in (estimate, truth)
    ]
    expected = torch.from_numpy((zyx[0] - zyx[1])[:, ::-1].copy())
    torch.testing.assert_close(euler_difference_deg(estimate, truth), expected)


def test_all_are_zero_at_the_truth() -> None:
    T = random_poses(200, generator=seeded(1))
    zeros = torch.zeros(200, dtype=torch.float64)
    assert torch.equal(error_r_deg(T, T), zeros)
    assert torch.equal(error_t(T, T), zeros)
    assert (euler_difference_deg(T, T) == 0).all()
    assert (translation_difference(T, T) == 0).all()


@pytest.mark.parametrize("angle_deg", [0.0, 1e-9, 1e-6, 90.0, 179.999999, 180.0])
def test_the_rotation_error_is_never_nan(angle_deg: float) -> None:
    base = random_poses(100, generator=seeded(2))
    turned = base @ about_x(angle_deg)
    errors = error_r_deg(turned, base)
    torch.testing.assert_close(errors, torch.full_like(errors, angle_deg), atol=1e-12, rtol=0)


def test_the_rotation_error_is_symmetric_and_blind_to_frames_and_translations() -> None:
    A, estimate, truth = random_poses(3, 50, generator=seeded(3))
    errors = error_r_deg(estimate, truth)
    torch.testing.assert_close(error_r_deg(truth, estimate), errors)
    torch.testing.assert_close(error_r_deg(A @ estimate, A @ truth), errors)
    estimate[:, :3, 3] += 100
    torch.testing.assert_close(error_r_deg(estimate, truth), errors)


def shown(shape: torch.Tensor, truth: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Noisy halves of a shape: one where it lies, the other where the pose carries it."""
    noise = 0.01 * torch.randn(2, 1, 200, 3, generator=seeded(8), dtype=torch.float64)
    source = shape[:, :200] + noise[0]
    return source, transform(truth, shape[:, 200:] + noise[1])


def test_the_modified_chamfer_distance_of_the_truth_is_the_noise_and_grows_with_the_angle() -> None:
    shape = torch.rand(1, 400, 3, generator=seeded(7), dtype=torch.float64)
    truth = random_poses(1, generator=seeded(9))
    clouds = shown(shape, truth)
    turned = [truth @ about_x(angle) for angle in (0, 2, 10)]
    near, further, far = (modified_chamfer(T, truth, *clouds, shape).item() for T in turned)
    assert near == pytest.approx(2 * 3 * 0.01**2, rel=0.2)
    assert near < further < far
    ratio = chamfer_ratio(turned[2], truth, *clouds, shape).item()
    assert ratio == pytest.approx(far / near)


def test_a_shape_turned_by_its_own_symmetry_is_as_near() -> None:
    half = torch.rand(1, 200, 3, generator=seeded(7), dtype=torch.float64)
    shape = torch.cat([half, transform(about_x(180), half)], dim=1)
    truth = random_poses(1, generator=seeded(9))
    ratio = chamfer_ratio(truth @ about_x(180), truth, *shown(shape, truth), shape)
    assert ratio.item() == pytest.approx(1, abs=0.02)


def test_without_noise_the_ratio_of_the_truth_is_at_most_one() -> None:
    shape = torch.rand(1, 50, 3, generator=seeded(7), dtype=torch.float64)
    truth = random_poses(1, generator=seeded(9))
    assert chamfer_ratio(truth, truth, shape, transform(truth, shape), shape).item() <= 1
