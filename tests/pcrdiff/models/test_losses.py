"""The losses: against SciPy and plain formulas, and worked by hand."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.models.losses import (
    chamfer_loss,
    diffusion_loss,
    inlier_loss,
    matching_losses,
    point_loss,
    pose_loss,
    rotation_loss,
    translation_loss,
)
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose


def clouds(n: int = 30, m: int = 40) -> tuple[torch.Tensor, torch.Tensor]:
    g = seeded(0)
    moved = torch.randn(2, n, 3, generator=g, dtype=torch.float64)
    return moved, torch.randn(2, m, 3, generator=g, dtype=torch.float64)


def test_the_diffusion_loss_worked_by_hand() -> None:
    prediction = torch.tensor([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    x_0 = torch.tensor([[0.0, 2.0, 1.0], [0.0, 1.0, 0.0]])
    assert diffusion_loss(prediction, x_0).item() == 1.5  # (5 / 2 + 1 / 2) / 2, Eq. 15


def test_chamfer_agrees_with_trees() -> None:
    moved, target = clouds()
    expected = sum(
        np.square(cKDTree(b).query(a)[0]).mean() / 2
        for p, q in zip(moved.numpy(), target.numpy(), strict=True)
        for a, b in ((p, q), (q, p))
    )
    assert chamfer_loss(moved, target).item() == pytest.approx(expected)


def test_the_gradient_of_chamfer_is_that_of_the_plain_minimum() -> None:
    ours, theirs = ([cloud.clone().requires_grad_() for cloud in clouds()] for _ in range(2))
    torch.autograd.backward(chamfer_loss(*ours))
    gaps = (theirs[0].unsqueeze(2) - theirs[1].unsqueeze(1)).square().sum(dim=-1)
    plain = gaps.min(dim=2).values.mean() + gaps.min(dim=1).values.mean()
    torch.autograd.backward(plain)
    for a, b in zip(ours, theirs, strict=True):
        torch.testing.assert_close(a.grad, b.grad, atol=1e-15, rtol=1e-12)


def test_chamfer_is_zero_on_copies_in_any_order_and_worked_by_hand() -> None:
    moved, _ = clouds()
    assert chamfer_loss(moved, moved.flip(1)).item() == 0
    a, b = torch.tensor([[[0.0, 0, 0]]]), torch.tensor([[[1.0, 0, 0], [0, 3, 0]]])
    assert chamfer_loss(a, b).item() == 1 + (1 + 9) / 2  # Eq. 16, with means for its sums


def test_the_pose_loss_is_zero_at_the_truth_only() -> None:
    T = random_poses(4, generator=seeded(1))
    assert pose_loss(T, T).item() == pytest.approx(0, abs=1e-14)
    assert pose_loss(T, small_pose(1.0, (0, 0, 0)) @ T) > 0.01


def test_the_pose_loss_worked_by_hand() -> None:
    shifted, turned = small_pose(0, (3.0, 0.0, 4.0)), small_pose(60, (0.0, 0.0, 0.0))
    eye = torch.eye(4, dtype=torch.float64)
    truth = torch.stack([shifted, turned])
    # |t| = 5; |R - I|_F = 2 sqrt(2) sin(angle / 2) = sqrt(2) at 60 degrees; Eq. 17
    loss = pose_loss(eye.repeat(2, 1, 1), truth)
    assert loss.item() == pytest.approx((5 + 2**0.5) / 2)


def test_the_pose_loss_does_not_care_where_the_target_frame_is() -> None:
    A, estimate, truth = random_poses(3, 4, generator=seeded(2))
    torch.testing.assert_close(pose_loss(A @ estimate, A @ truth), pose_loss(estimate, truth))
    expected = np.linalg.norm((invert(estimate) @ truth).numpy() - np.eye(4), axis=(1, 2)).mean()
    assert pose_loss(estimate, truth).item() == pytest.approx(expected)


def test_the_point_loss_worked_by_hand() -> None:
    cloud, _ = clouds()
    shifted = transform(small_pose(0, (0.3, 0.0, -0.6)).expand(2, 4, 4), cloud)
    assert point_loss(cloud, cloud).item() == 0
    assert point_loss(shifted, cloud).item() == pytest.approx(0.3)  # (0.3 + 0 + 0.6) / 3


def test_the_inlier_loss_worked_by_hand() -> None:
    assert inlier_loss(torch.eye(4).unsqueeze(0)).item() == 0
    matches = torch.tensor([[[0.5, 0.0], [0.0, 1.0], [0.0, 0.0]]])
    # rows fall short by 0.5, 0, 1 and columns by 0.5, 0
    assert inlier_loss(matches).item() == pytest.approx(0.5 + 0.25)


def test_the_rotation_loss_worked_by_hand() -> None:
    truth = torch.stack([small_pose(0, (0, 0, 0)), small_pose(60, (5.0, 0, 0))])
    eye = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    # |R - I|_F^2 = 8 sin^2(angle / 2) = 2 at 60 degrees, over 9 entries and 2 pairs
    assert rotation_loss(eye, truth).item() == pytest.approx(2 / 9 / 2)
    assert rotation_loss(truth, truth).item() == pytest.approx(0, abs=1e-14)


def test_the_rotation_loss_does_not_care_where_either_frame_is() -> None:
    A, estimate, truth = random_poses(3, 4, generator=seeded(3))
    loss = rotation_loss(estimate, truth)
    torch.testing.assert_close(rotation_loss(A @ estimate, A @ truth), loss)
    torch.testing.assert_close(rotation_loss(estimate @ A, truth @ A), loss)


def test_the_translation_loss_worked_by_hand() -> None:
    estimate = torch.stack([small_pose(30, (1.0, 0, 0)), small_pose(0, (0, 0, 0))])
    truth = torch.stack([small_pose(0, (0, 0, 0)), small_pose(50, (0, 3.0, 4.0))])
    assert translation_loss(estimate, truth).item() == pytest.approx((1 + 25) / 6)
    assert translation_loss(truth, truth).item() == 0


def test_the_losses_of_matching_halve_with_every_update_that_follows() -> None:
    source = torch.rand(2, 7, 3, generator=seeded(5), dtype=torch.float64)
    truth = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    off = small_pose(0, (0.3, 0.3, 0.3)).expand(2, 4, 4)
    all_matched = torch.eye(7, dtype=torch.float64).repeat(2, 1, 1)
    steps = [(off, all_matched), (truth, 0 * all_matched), (off, all_matched / 2)]
    terms = matching_losses(steps, truth, source)
    assert set(terms) == {"points", "inliers"}
    assert terms["points"].item() == pytest.approx(0.25 * 0.3 + 0.3)
    assert terms["inliers"].item() == pytest.approx(0.01 * (0.5 * 2 + 1))
