"""Poses from matches, most of them wrong."""

import torch
from torch import Tensor

from pcrdiff.geometry.consistency import consistent_poses, triple_poses
from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import transform
from tests.pcrdiff.synthetic_clouds import seeded, small_pose

TRUTH = small_pose(70, (0.4, -0.1, 0.2))


def matches(right: int, wrong: int, noise: float = 0.0) -> tuple[Tensor, Tensor]:
    """Matches under ``TRUTH`` among others between random points of two unit cubes."""
    generator = seeded(3)
    source = torch.rand(right + wrong, 3, dtype=torch.float64, generator=generator)
    target = transform(TRUTH, source)
    target += noise * torch.randn(target.shape, dtype=torch.float64, generator=generator)
    target[right:] = torch.rand(wrong, 3, dtype=torch.float64, generator=generator)
    order = torch.randperm(right + wrong, generator=generator)
    return source[order], target[order]


def errors(poses: Tensor) -> tuple[Tensor, Tensor]:
    truth = TRUTH.expand(len(poses), 4, 4)
    return error_r_deg(poses, truth), error_t(poses, truth)


def test_the_pose_of_a_tenth_of_the_matches_comes_first() -> None:
    poses = consistent_poses(*matches(30, 270, noise=0.005), tolerance=0.03)
    degrees, shift = errors(poses)
    assert (degrees[0] < 2) & (shift[0] < 0.02)


def test_no_pose_is_alike_to_a_better_supported_one() -> None:
    poses = consistent_poses(*matches(30, 270), tolerance=0.03)
    degrees, shift = errors(poses)
    assert len(poses) > 10
    assert ((degrees < 5) & (shift < 0.03)).sum() == 1


def test_the_order_of_the_matches_does_not_matter() -> None:
    source, target = matches(40, 100)
    there = consistent_poses(source.flip(0), target.flip(0), tolerance=0.03)
    here = consistent_poses(source, target, tolerance=0.03)
    torch.testing.assert_close(here[0], there[0])


def test_all_matches_of_two_points_still_give_a_finite_pose() -> None:
    source = torch.zeros(5, 3, dtype=torch.float64)
    source[::2] = 1.0
    poses = consistent_poses(source, source + 0.5, tolerance=0.03)
    assert poses.isfinite().all()


def test_triples_of_right_matches_pass_the_check_and_come_first() -> None:
    poses = triple_poses(*matches(60, 60), 8, generator=seeded(0))
    degrees, shift = errors(poses)
    assert len(poses) == 8
    assert ((degrees < 1e-3) & (shift < 1e-6)).sum() >= 6


def test_as_many_triples_as_are_asked_for_even_where_none_keeps_its_lengths() -> None:
    source, target = matches(0, 40)
    assert triple_poses(source, 100 * target, 5, generator=seeded(0)).shape == (5, 4, 4)
