"""Twists: the exponential against SciPy, near zero, and the laws of one-parameter groups."""

import math

import pytest
import torch
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.geometry.twist import exp_twist, hat
from tests.pcrdiff.synthetic_clouds import seeded

BATCHES = [(), (1,), (3, 2)]
LENGTHS = [0.0, 1e-12, 1e-8, 1e-4, 0.1, 1.0, math.pi - 1e-6, math.pi, 6.0]


def twists(*batch: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*batch, 6, generator=seeded(seed), dtype=torch.float64)


@pytest.mark.parametrize("batch", BATCHES)
def test_hat_is_the_cross_product(batch: tuple[int, ...]) -> None:
    w, x = twists(*batch)[..., :3], twists(*batch)[..., 3:]
    torch.testing.assert_close((hat(w) @ x.unsqueeze(-1)).squeeze(-1), torch.linalg.cross(w, x))


@pytest.mark.parametrize("length", LENGTHS)
def test_the_exponential_is_scipys(length: float) -> None:
    for twist in twists(5):
        twist = twist * length / twist[:3].norm()
        matrix = torch.zeros(4, 4, dtype=torch.float64)
        matrix[:3, :3], matrix[:3, 3] = hat(twist[:3]), twist[3:]
        wanted = torch.from_numpy(expm(matrix.numpy()))
        torch.testing.assert_close(exp_twist(twist), wanted, atol=1e-13, rtol=0)
        R = torch.from_numpy(Rotation.from_rotvec(twist[:3].numpy()).as_matrix())
        torch.testing.assert_close(exp_twist(twist)[:3, :3], R, atol=1e-13, rtol=0)


@pytest.mark.parametrize("batch", BATCHES)
def test_a_quarter_turn_about_z_on_a_helix_worked_by_hand(batch: tuple[int, ...]) -> None:
    twist = torch.tensor([0, 0, math.pi / 2, 0, 0, 7.0], dtype=torch.float64).expand(*batch, 6)
    wanted = torch.tensor([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 7], [0, 0, 0, 1]])
    wanted = wanted.double().expand(*batch, 4, 4)
    torch.testing.assert_close(exp_twist(twist), wanted, atol=1e-14, rtol=0)


def test_near_zero_it_is_a_shift_by_w_cross_x_plus_v() -> None:
    twist, points = 1e-6 * twists(4), torch.randn(4, 9, 3, generator=seeded(1)).double()
    w, v = twist[:, None, :3], twist[:, None, 3:]
    moved = points + torch.linalg.cross(w.expand_as(points), points) + v
    torch.testing.assert_close(transform(exp_twist(twist), points), moved, atol=1e-10, rtol=0)


def test_twice_along_a_twist_is_along_its_double_and_back_is_the_inverse() -> None:
    twist = twists(3, 2)
    T = exp_twist(twist)
    torch.testing.assert_close(T @ T, exp_twist(2 * twist), atol=1e-12, rtol=0)
    torch.testing.assert_close(invert(T), exp_twist(-twist), atol=1e-12, rtol=0)


@pytest.mark.parametrize("length", [0.0, 1e-9, 1.0, 3.0])
def test_gradients_are_those_of_finite_differences_also_at_zero(length: float) -> None:
    twist = torch.nn.functional.normalize(twists(2), dim=-1) * length
    assert torch.autograd.gradcheck(exp_twist, twist.requires_grad_())
