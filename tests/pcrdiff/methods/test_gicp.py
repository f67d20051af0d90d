"""Generalized ICP from the shift between the centroids."""

import pytest
import torch

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import registration
from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.methods.gicp import GICP
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose, synthetic_pairs

METHOD = GICP(max_iterations=30, max_distance=0.5)


def test_solves_exact_copies() -> None:
    pairs = synthetic_pairs(4, 300, generator=seeded(0))
    answer = METHOD.register(pairs.source, pairs.target, generator=seeded(0))
    assert error_r_deg(answer, pairs.T_target_source).max() < 0.05
    assert error_t(answer, pairs.T_target_source).max() < 1e-3


def test_a_translation_however_long_is_seen_through() -> None:
    pairs = synthetic_pairs(3, 200, generator=seeded(1))
    source, target = pairs.source.double(), pairs.target.double()
    shift = small_pose(0, (70.0, -40.0, 10.0)).expand(3, 4, 4)
    answer = METHOD.register(source, target, generator=seeded(0))
    moved = METHOD.register(source, transform(shift, target), generator=seeded(0))
    assert error_r_deg(moved, shift @ answer).max() < 0.05


def test_the_answer_follows_when_both_clouds_move_together() -> None:
    pairs = synthetic_pairs(3, 200, generator=seeded(2))
    source, target = pairs.source.double(), pairs.target.double()
    A = random_poses(3, generator=seeded(3))
    answer = METHOD.register(source, target, generator=seeded(0))
    moved = METHOD.register(transform(A, source), transform(A, target), generator=seeded(0))
    expected = A @ answer @ invert(A)
    assert error_r_deg(moved, expected).max() < 0.1
    assert error_t(moved, expected).max() < 1e-2


def test_leaves_open3ds_threads_as_they_were_and_answers_alike_each_time() -> None:
    pairs = synthetic_pairs(1, 2000, generator=seeded(4))
    threads = open3d.utility.get_max_threads()
    answers = [METHOD.register(pairs.source, pairs.target, generator=seeded(0)) for _ in range(5)]
    assert all(torch.equal(answer, answers[0]) for answer in answers)
    assert open3d.utility.get_max_threads() == threads


def test_refuses_clouds_of_which_no_two_points_are_within_reach() -> None:
    pairs = synthetic_pairs(1, 50, generator=seeded(5))
    ring = 100 * torch.nn.functional.normalize(pairs.target - pairs.target.mean(dim=1), dim=-1)
    with pytest.raises(
        ValueError, match=r"^gicp needs points within 0\.5 of each other where it ends, got none"
    ):
        METHOD.register(pairs.source, torch.cat([ring, -ring], dim=1), generator=seeded(0))


def test_the_settings_are_open3ds_own() -> None:
    assert registration.TransformationEstimationForGeneralizedICP().epsilon == 0.001
    assert registration.ICPConvergenceCriteria().max_iteration == METHOD.max_iterations
