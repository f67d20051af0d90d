"""fit_rigid: exact on exact matches, a rotation always, loud on nothing to fit."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import invert, transform
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose


def matched_clouds(seed: int, noise: float = 0.3) -> tuple[torch.Tensor, ...]:
    """Two batches of 20 matches that no pose fits exactly, and their weights."""
    g = seeded(seed)
    source = torch.randn(2, 20, 3, generator=g, dtype=torch.float64)
    target = transform(random_poses(2, generator=g), source)
    target = target + noise * torch.randn(2, 20, 3, generator=g, dtype=torch.float64)
    return source, target, torch.rand(2, 20, generator=g, dtype=torch.float64)


@given(seed=st.integers(0, 2**32 - 1))
def test_recovers_the_pose_of_exact_matches(seed: int) -> None:
    T_target_source = random_poses(2, generator=seeded(seed))
    source, _, weights = matched_clouds(seed)
    fitted = fit_rigid(source, transform(T_target_source, source), weights)
    torch.testing.assert_close(fitted, T_target_source)


@pytest.mark.parametrize("angle_deg", [0.0, 1e-6, 179.9999, 180.0])
def test_recovers_it_near_identity_and_near_180_degrees(angle_deg: float) -> None:
    T_target_source = small_pose(angle_deg, (3.0, 2.0, 1.0)).unsqueeze(0)
    source = matched_clouds(0)[0][:1]
    ones = torch.ones(1, 20, dtype=torch.float64)
    fitted = fit_rigid(source, transform(T_target_source, source), ones)
    torch.testing.assert_close(fitted, T_target_source, atol=1e-12, rtol=0)


def test_agrees_with_scipy_on_noisy_weighted_matches() -> None:
    source, target, weights = matched_clouds(1)
    fitted = fit_rigid(source, target, weights)
    for i in range(2):
        w = weights[i] / weights[i].sum()
        p, q = source[i] - w @ source[i], target[i] - w @ target[i]
        R, _ = Rotation.align_vectors(q.numpy(), p.numpy(), weights=w.numpy())
        torch.testing.assert_close(fitted[i, :3, :3], torch.from_numpy(R.as_matrix()))
        torch.testing.assert_close(
            fitted[i, :3, 3], w @ target[i] - fitted[i, :3, :3] @ (w @ source[i])
        )


def test_no_pose_nearby_fits_better() -> None:
    source, target, weights = matched_clouds(2)
    fitted = fit_rigid(source, target, weights)

    def cost(T: torch.Tensor) -> torch.Tensor:
        return (weights * (transform(T, source) - target).square().sum(dim=-1)).sum(dim=-1)

    for nudge in (
        small_pose(0.1, (0, 0, 0)),
        small_pose(-0.1, (0, 0, 0)),
        small_pose(0, (0, 1e-3, 0)),
    ):
        assert (cost(nudge @ fitted) > cost(fitted)).all()


def test_the_answer_follows_when_both_clouds_move() -> None:
    source, target, weights = matched_clouds(3)
    A, B = random_poses(2, 2, generator=seeded(4))
    moved = fit_rigid(transform(A, source), transform(B, target), weights)
    torch.testing.assert_close(moved, B @ fit_rigid(source, target, weights) @ invert(A))


def test_matches_without_weight_are_as_good_as_absent_and_only_ratios_matter() -> None:
    source, target, weights = matched_clouds(5)
    weights[:, 10:] = 0
    kept = fit_rigid(source[:, :10], target[:, :10], 7 * weights[:, :10])
    torch.testing.assert_close(fit_rigid(source, target, weights), kept)


@pytest.mark.parametrize("flat", [(1.0, 1.0, -1.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)])
def test_the_answer_is_a_rotation_for_mirrored_flat_and_straight_clouds(
    flat: tuple[float, float, float],
) -> None:
    source, _, weights = matched_clouds(6)
    target = source * torch.tensor(flat, dtype=torch.float64)
    R = fit_rigid(source, target, weights)[:, :3, :3]
    torch.testing.assert_close(torch.det(R), torch.ones(2, dtype=torch.float64))
    torch.testing.assert_close(R @ R.mT, torch.eye(3, dtype=torch.float64).expand_as(R))


def test_gradients_are_those_of_finite_differences() -> None:
    source, target, weights = (x.requires_grad_() for x in matched_clouds(7))
    assert torch.autograd.gradcheck(fit_rigid, (source, target, weights))


def test_refuses_a_batch_item_without_weight() -> None:
    points = torch.zeros(3, 5, 3)
    weights = torch.ones(3, 5)
    weights[1] = 0
    weights[2, 0] = torch.nan
    with pytest.raises(ValueError, match=r"items \[1, 2\] have none"):
        fit_rigid(points, points, weights)


def test_the_signature_refuses_clouds_of_unequal_length() -> None:
    with pytest.raises(Exception, match="points"):
        fit_rigid(torch.zeros(2, 5, 3), torch.zeros(2, 4, 3), torch.ones(2, 5))


@pytest.mark.parametrize("spread", [0.0, 1e-12, 1e-6])
def test_the_gradient_is_finite_where_all_matches_are_one_point(spread: float) -> None:
    source = torch.randn(1, 20, 3, generator=seeded(3))
    target = 0.3 + spread * torch.randn(1, 20, 3, generator=seeded(4))
    target.requires_grad_()
    fitted = fit_rigid(source, target, torch.ones(1, 20))
    transform(fitted, source).square().sum().backward()  # type: ignore[no-untyped-call]
    assert target.grad is not None
    assert target.grad.isfinite().all()
