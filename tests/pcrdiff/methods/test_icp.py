"""ICP from where the clouds lie."""

import pytest
import torch

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.methods.icp import ICP
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded, small_pose


def near_copies(angle_deg: float = 5.0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    source = lopsided_clouds(3, 200, generator=seeded(0)).double()
    T = small_pose(angle_deg, (0.02, -0.03, 0.01)).expand(3, 4, 4)
    return source, transform(T, source).flip(1), T


def test_finds_a_small_motion_of_exact_copies() -> None:
    source, target, T = near_copies()
    answer = ICP(100, 0.5).register(source, target, generator=seeded(0))
    assert error_r_deg(answer, T).max() < 1e-3
    assert error_t(answer, T).max() < 1e-5


def test_the_answer_follows_when_both_clouds_move_together() -> None:
    source, target, _ = near_copies()
    A = random_poses(3, generator=seeded(1))
    method = ICP(30, 0.5)
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(transform(A, source), transform(A, target), generator=seeded(0))
    torch.testing.assert_close(moved, A @ answer @ invert(A), atol=1e-8, rtol=0)


def test_more_rounds_bring_it_nearer() -> None:
    source, target, T = near_copies(15.0)
    errors = [
        error_r_deg(ICP(rounds, 0.5).register(source, target, generator=seeded(0)), T).mean()
        for rounds in (1, 5, 50)
    ]
    assert errors[0] > errors[1] > errors[2]


def test_points_out_of_reach_do_not_pull() -> None:
    source, target, T = near_copies()
    far = torch.full((3, 20, 3), 5.0, dtype=torch.float64)
    littered = torch.cat([source, far], dim=1)
    answer = ICP(100, 0.5).register(littered, target, generator=seeded(0))
    assert error_r_deg(answer, T).max() < 1e-3


def test_refuses_clouds_of_which_no_two_points_are_within_reach() -> None:
    source, target, _ = near_copies()
    with pytest.raises(ValueError, match=r"^icp\w* "):
        ICP(10, 0.1).register(source, target + 100, generator=seeded(0))
