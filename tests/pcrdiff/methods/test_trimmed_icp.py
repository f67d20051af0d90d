"""Trimmed ICP from the shift between the centroids."""

import torch

from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.methods.icp_centroid import ICPCentroid
from pcrdiff.methods.trimmed_icp import TrimmedICP
from pcrdiff.metrics import error_r_deg, error_t
from tests.pcrdiff.made_up_clouds import made_up_pairs, random_poses, seeded, small_pose

METHOD = TrimmedICP(max_iterations=100)


def test_solves_exact_copies() -> None:
    pairs = made_up_pairs(4, 300, generator=seeded(0))
    answer = METHOD.register(pairs.source, pairs.target, generator=seeded(0))
    assert error_r_deg(answer, pairs.T_target_source).max() < 0.01
    assert error_t(answer, pairs.T_target_source).max() < 1e-4


def test_a_translation_however_long_is_seen_through() -> None:
    pairs = made_up_pairs(3, 200, generator=seeded(1))
    source, target = pairs.source.double(), pairs.target.double()
    shift = small_pose(0, (70.0, -40.0, 10.0)).expand(3, 4, 4)
    answer = METHOD.register(source, target, generator=seeded(0))
    moved = METHOD.register(source, transform(shift, target), generator=seeded(0))
    torch.testing.assert_close(moved, shift @ answer, atol=1e-7, rtol=0)


def test_the_answer_follows_when_both_clouds_move_together() -> None:
    pairs = made_up_pairs(3, 200, generator=seeded(2))
    source, target = pairs.source.double(), pairs.target.double()
    A = random_poses(3, generator=seeded(3))
    answer = METHOD.register(source, target, generator=seeded(0))
    moved = METHOD.register(transform(A, source), transform(A, target), generator=seeded(0))
    torch.testing.assert_close(moved, A @ answer @ invert(A), atol=1e-7, rtol=0)


def test_finds_the_share_that_overlaps_where_icp_is_pulled_away() -> None:
    pairs = made_up_pairs(3, 400, generator=seeded(4))
    target = pairs.source.double()
    order = target[..., 0].argsort(dim=-1)[:, 100:]  # a quarter is cut off at one end
    target = target.gather(1, order[..., None].expand(-1, -1, 3))
    T = small_pose(5, (0.0, 0.0, 0.0)).expand(3, 4, 4)
    source, target = pairs.source.double(), transform(T, target)
    trimmed = METHOD.register(source, target, generator=seeded(0))
    plain = ICPCentroid(100, 0.5).register(source, target, generator=seeded(0))
    assert error_r_deg(trimmed, T).max() < 0.01
    assert error_r_deg(plain, T).min() > 0.5


def test_draws_nothing() -> None:
    pairs = made_up_pairs(1, 100, generator=seeded(5))
    first, second = (
        METHOD.register(pairs.source, pairs.target, generator=seeded(k)) for k in (0, 1)
    )
    assert torch.equal(first, second)
