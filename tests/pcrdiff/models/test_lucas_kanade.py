"""Lucas-Kanade on features: its Jacobian, its solver, and where it leads."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.geometry.rotation import geodesic_angle
from pcrdiff.geometry.twist import exp_twist
from pcrdiff.models import lucas_kanade
from pcrdiff.models.lucas_kanade import LONGEST, align, damped_inverse, pose_jacobian
from pcrdiff.models.pointnet import PointNet
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded, synthetic_pairs

DIFFERENCE = 0.1


def make(dim: int = 128) -> PointNet:
    torch.manual_seed(0)
    return PointNet((32, 32, dim)).double()


def clouds(batch: int = 2, n: int = 60) -> Tensor:
    return lopsided_clouds(batch, n, generator=seeded(1)).double()


def test_the_jacobian_is_autograds_where_the_difference_is_small() -> None:
    encoder, cloud = make(), clouds()
    ours = pose_jacobian(encoder, cloud, encoder(cloud), difference=1e-7)
    for k in range(len(cloud)):
        twist = torch.zeros(6, dtype=torch.float64, requires_grad=True)
        features = encoder(transform(exp_twist(twist), cloud[k])[None])[0]
        theirs = torch.stack(
            [torch.autograd.grad(f, twist, retain_graph=True)[0] for f in features]
        )
        assert theirs.abs().max() > 0.1
        torch.testing.assert_close(ours[k], theirs, atol=1e-6, rtol=0)


@pytest.mark.parametrize("difference", [0.01, 0.1])
def test_it_is_the_backward_difference_worked_axis_by_axis(difference: float) -> None:
    encoder, cloud = make(), clouds()
    ours = pose_jacobian(encoder, cloud, encoder(cloud), difference)
    for k in range(3):
        turn = Rotation.from_rotvec(-difference * np.eye(3)[k]).as_matrix()
        turned = cloud @ torch.from_numpy(turn).mT
        shifted = cloud - difference * torch.eye(3, dtype=torch.float64)[k]
        for column, moved in ((k, turned), (3 + k, shifted)):
            slope = (encoder(cloud) - encoder(moved)) / difference
            torch.testing.assert_close(ours[..., column], slope)


def test_the_inverse_is_the_pseudo_inverse_but_for_the_damping(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    J = torch.randn(3, 40, 6, generator=seeded(2), dtype=torch.float64)
    torch.testing.assert_close(damped_inverse(J), torch.linalg.pinv(J), atol=1e-3, rtol=0)
    monkeypatch.setattr(lucas_kanade, "DAMPING", 0.0)
    torch.testing.assert_close(damped_inverse(J), torch.linalg.pinv(J))


@pytest.mark.parametrize("rank", [0, 1, 3, 5])
def test_it_is_finite_and_has_a_gradient_where_nothing_can_be_solved_for(rank: int) -> None:
    J = torch.randn(2, 40, 6, generator=seeded(3), dtype=torch.float64)
    J[..., rank:] = 0
    J.requires_grad_()
    inverse = damped_inverse(J)
    assert torch.isfinite(inverse).all()
    torch.autograd.backward(inverse.sum())
    assert J.grad is not None
    assert torch.isfinite(J.grad).all()


def test_solves_exact_copies_wherever_they_lie_even_untrained() -> None:
    pairs, encoder = synthetic_pairs(4, 256, generator=seeded(0)), make()
    source, target = pairs.source.double(), pairs.target.double()
    poses = align(encoder, source, target, difference=DIFFERENCE, updates=20)
    assert error_r_deg(poses[-1], pairs.T_target_source).max() < 0.01
    assert error_t(poses[-1], pairs.T_target_source).max() < 1e-4
    shift_p, shift_q = torch.tensor([5.0, -7, 3]).double(), torch.tensor([-1.0, 2, 9]).double()
    T_p, T_q = torch.eye(4).double().repeat(4, 1, 1), torch.eye(4).double().repeat(4, 1, 1)
    T_p[:, :3, 3], T_q[:, :3, 3] = shift_p, shift_q
    moved = align(encoder, source + shift_p, target + shift_q, difference=DIFFERENCE, updates=20)
    torch.testing.assert_close(moved[0], T_q @ poses[0] @ invert(T_p), atol=1e-9, rtol=0)
    torch.testing.assert_close(moved[-1], T_q @ poses[-1] @ invert(T_p), atol=1e-6, rtol=0)


def test_the_true_pose_is_where_it_stays() -> None:
    cloud = clouds()
    poses = align(make(), cloud, cloud.flip(1), difference=DIFFERENCE, updates=20)
    assert len(poses) == 1  # nothing to move, so no second update
    eye = torch.eye(4, dtype=torch.float64).expand(2, 4, 4)
    torch.testing.assert_close(poses[0], eye, atol=1e-10, rtol=0)


def test_goes_as_far_as_it_is_told_and_no_step_is_longer_than_the_longest() -> None:
    source, target = clouds(), transform(random_poses(2, generator=seeded(4)), clouds())
    for updates in (1, 3):
        assert len(align(make(), source, target, DIFFERENCE, updates)) == updates
    poses = align(make(), 20 * source, target, difference=DIFFERENCE, updates=8)
    eye = torch.eye(4, dtype=torch.float64).expand(2, 4, 4)
    for before, after in zip([eye, *poses], poses, strict=False):
        angle = geodesic_angle(before[:, :3, :3], after[:, :3, :3])
        assert (angle <= LONGEST + 1e-6).all()


def test_the_first_step_is_gauss_newtons() -> None:
    encoder, source = make(), clouds()
    source = source - source.mean(dim=1, keepdim=True)
    twist = 0.05 * normalize(torch.randn(2, 6, generator=seeded(5), dtype=torch.float64), dim=-1)
    target = transform(exp_twist(twist), source)
    target = target - target.mean(dim=1, keepdim=True)
    r = encoder(source) - encoder(target)
    J = pose_jacobian(encoder, target, encoder(target), DIFFERENCE)
    step = -(damped_inverse(J) @ r.unsqueeze(-1)).squeeze(-1)
    (pose,) = align(encoder, source, target, difference=DIFFERENCE, updates=1)
    torch.testing.assert_close(pose[:, :3, :3], exp_twist(step)[:, :3, :3])


@pytest.mark.parametrize("axes", [0, 1, 2])
def test_flat_straight_and_point_like_clouds_do_not_crash_it(axes: int) -> None:
    cloud = clouds()
    cloud[..., axes:] = 0
    poses = align(make(), cloud, 2 * cloud.flip(1), difference=DIFFERENCE, updates=5)
    R = poses[-1][:, :3, :3]
    torch.testing.assert_close(R @ R.mT, torch.eye(3, dtype=torch.float64).expand(2, 3, 3))


def test_an_update_passes_no_gradient_to_the_next() -> None:
    encoder, source = make(), clouds()
    encoded: list[Tensor] = []
    encoder.register_forward_hook(lambda _module, _inputs, output: encoded.append(output))
    _, second = align(
        encoder, source, transform(random_poses(2, generator=seeded(6)), source), DIFFERENCE, 2
    )
    before, now = torch.autograd.grad(second.sum(), encoded[-2:], allow_unused=True)
    assert before is None
    assert now.abs().max() > 0
