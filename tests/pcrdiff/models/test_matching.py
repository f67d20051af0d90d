"""Soft matches: against a slow twin, and where they must lead."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import transform
from pcrdiff.models import matching
from pcrdiff.models.matching import (
    AnnealingNet,
    Matchable,
    fit_matches,
    fit_pointers,
    match_scores,
    sinkhorn,
)
from tests.pcrdiff.largest_tensor import LargestTensor
from tests.pcrdiff.made_up_clouds import (
    lopsided_clouds,
    made_up_pairs,
    random_poses,
    seeded,
    true_matches,
)


def scores(n: int = 7, m: int = 9, spread: float = 3.0) -> Tensor:
    return spread * torch.randn(2, n, m, generator=seeded(0), dtype=torch.float64)


def with_slack(matrix: Tensor) -> Tensor:
    """One more row and column whose scores are 0."""
    return torch.nn.functional.pad(matrix, (0, 1, 0, 1))


def slow_twin(matrix: Tensor, iterations: int) -> Tensor:
    """RPM-Net's normalisations carried out one by one on the whole padded matrix."""
    matches = with_slack(matrix).exp()
    for _ in range(iterations):
        matches[:, :-1] /= matches[:, :-1].sum(dim=2, keepdim=True)
        matches[:, :, :-1] /= matches[:, :, :-1].sum(dim=1, keepdim=True)
    return matches[:, :-1, :-1]


def logarithmic_twin(matrix: Tensor, iterations: int) -> Tensor:
    """The same in logarithms, which no score is too large for."""
    matches = with_slack(matrix)
    for _ in range(iterations):
        matches[:, :-1] -= matches[:, :-1].logsumexp(dim=2, keepdim=True)
        matches[:, :, :-1] -= matches[:, :, :-1].logsumexp(dim=1, keepdim=True)
    return matches[:, :-1, :-1].exp()


@pytest.mark.parametrize("iterations", [1, 2, 5, 30])
def test_agrees_with_a_slow_twin(iterations: int) -> None:
    expected = slow_twin(scores(), iterations)
    torch.testing.assert_close(sinkhorn(scores(), iterations), expected)


@pytest.mark.parametrize("shift", [-200.0, -60.0, 0.0, 60.0, 200.0])
@pytest.mark.parametrize("spread", [1.0, 30.0])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_agrees_with_logarithms_for_scores_of_any_size(
    shift: float, spread: float, dtype: torch.dtype
) -> None:
    matrix = scores(spread=spread) + shift
    matches = sinkhorn(matrix.to(dtype), 5)
    expected = logarithmic_twin(matrix, 5)
    torch.testing.assert_close(matches.double(), expected, atol=2e-4, rtol=0)


def test_a_clear_favourite_wins_however_large_the_scores() -> None:
    matches = sinkhorn(torch.tensor([[[100.0, 70.0], [70.0, 100.0]]]), 20)
    torch.testing.assert_close(matches[0], torch.eye(2), atol=0.06, rtol=0)


def test_gradients_are_those_of_finite_differences_for_small_and_large_scores() -> None:
    for shift in (0.0, 80.0):
        matrix = (scores(3, 4, 2.0) + shift).requires_grad_()
        assert torch.autograd.gradcheck(lambda x: sinkhorn(x, 3), matrix)


@pytest.mark.parametrize("iterations", [1, 5, 200])
def test_no_column_ever_sums_to_more_than_one(iterations: int) -> None:
    matches = sinkhorn(scores(9, 4), iterations)
    assert (matches >= 0).all()
    assert (matches.sum(dim=-2) <= 1).all()


def test_many_rows_that_want_one_column_share_it_without_overflow() -> None:
    matrix = torch.full((1, 300, 4), -50.0)
    matrix[..., 0] = 200.0
    matches = sinkhorn(matrix, 100)
    assert torch.isfinite(matches).all()
    assert 0.9 < matches[..., 0].sum() <= 1 + 1e-5


def test_no_row_sums_to_more_than_one_once_it_has_settled() -> None:
    for n, m in ((7, 9), (9, 4), (5, 5)):
        assert (sinkhorn(scores(n, m), 2000).sum(dim=-1) <= 1 + 1e-6).all()


def test_recovers_a_clear_permutation() -> None:
    order = torch.randperm(8, generator=seeded(1))
    matrix = torch.full((1, 8, 8), -20.0)
    matrix[0, torch.arange(8), order] = 20.0
    matches = sinkhorn(matrix, 50)
    assert torch.equal(matches[0].argmax(dim=-1), order)
    torch.testing.assert_close(matches.sum(dim=-1), torch.ones(1, 8), atol=0.05, rtol=0)


def test_a_point_without_a_match_finds_room_in_the_slack() -> None:
    matrix = torch.full((1, 3, 3), -20.0)
    matrix[0, 0, 0] = matrix[0, 1, 1] = 20.0
    matches = sinkhorn(matrix, 50)
    assert matches[0, 2].sum() < 1e-6
    assert matches[0, :, 2].sum() < 1e-6
    assert matches[0, 0, 0] > 0.95


def test_the_order_of_the_points_is_followed() -> None:
    rows, columns = torch.randperm(7, generator=seeded(2)), torch.randperm(9, generator=seeded(3))
    shuffled = sinkhorn(scores()[:, rows][:, :, columns], 5)
    torch.testing.assert_close(shuffled, sinkhorn(scores(), 5)[:, rows][:, :, columns])


def test_a_score_worked_by_hand() -> None:
    source, target = torch.tensor([[[1.0, 0.0]]]), torch.tensor([[[0.0, 2.0], [1.0, 0.0]]])
    alpha, beta = torch.tensor([3.0]), torch.tensor([0.5])
    expected = torch.tensor([[[-1.0, 1.5]]])  # -0.5 (5 - 3), -0.5 (0 - 3)
    torch.testing.assert_close(match_scores(source, target, alpha, beta), expected)


def test_annealing_is_positive_and_of_each_pair_alone() -> None:
    torch.manual_seed(0)
    net = AnnealingNet()
    source = lopsided_clouds(3, 20, generator=seeded(4))
    target = lopsided_clouds(3, 15, generator=seeded(5))
    alpha, beta = net(source, target)
    assert (alpha > 0).all()
    assert (beta > 0).all()
    alone = net(source[1:2], target[1:2])
    torch.testing.assert_close(alone, (alpha[1:2], beta[1:2]))
    shuffled = net(source.flip(1), target.flip(1))
    torch.testing.assert_close(shuffled, (alpha, beta))


def test_annealing_knows_which_cloud_is_which() -> None:
    torch.manual_seed(0)
    net = AnnealingNet()
    clouds = lopsided_clouds(2, 20, generator=seeded(6))
    source, target = clouds[:1], clouds[1:]
    assert not torch.allclose(net(source, target)[0], net(target, source)[0], rtol=1e-4)


def pointed() -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Two clouds of other sizes and any features of their points."""
    source = lopsided_clouds(2, 12, generator=seeded(7)).double()
    target = lopsided_clouds(2, 9, generator=seeded(8)).double()
    g = seeded(9)
    source_features = torch.randn(2, 12, 16, generator=g, dtype=torch.float64)
    target_features = torch.randn(2, 9, 16, generator=g, dtype=torch.float64)
    return source, target, source_features, target_features


def test_pointers_agree_with_a_slow_twin() -> None:
    source, target, source_features, target_features = pointed()
    rows = []
    for pair in range(2):
        for feature in source_features[pair]:
            weights = torch.stack([(feature * other).sum() / 4 for other in target_features[pair]])
            weights = weights.exp() / weights.exp().sum()  # 4 is the root of 16
            rows.append((weights.unsqueeze(-1) * target[pair]).sum(dim=0))
    places = torch.stack(rows).view(2, 12, 3)
    expected = fit_rigid(source, places, torch.ones(2, 12, dtype=torch.float64))
    torch.testing.assert_close(fit_pointers(*pointed()), expected)


def test_pointers_that_are_sure_of_their_copies_give_the_exact_pose() -> None:
    pairs = made_up_pairs(3, 30, generator=seeded(10))
    features = 40 * torch.eye(30).expand(3, -1, -1)
    target = transform(pairs.T_target_source, pairs.source.double()).float()
    answer = fit_pointers(pairs.source, target.flip(1), features, features.flip(1))
    torch.testing.assert_close(answer, pairs.T_target_source.float(), atol=1e-5, rtol=0)


def test_the_pose_that_pointers_fit_follows_the_target_and_forgets_the_order() -> None:
    source, target, source_features, target_features = pointed()
    answer, A = fit_pointers(*pointed()), random_poses(2, generator=seeded(11))
    moved = fit_pointers(source, transform(A, target), source_features, target_features)
    torch.testing.assert_close(moved, A @ answer)
    shuffled = fit_pointers(
        source.flip(1), target.roll(3, 1), source_features.flip(1), target_features.roll(3, 1)
    )
    torch.testing.assert_close(shuffled, answer)


def test_perfect_matches_give_the_pose_also_where_some_points_have_none() -> None:
    pairs = made_up_pairs(3, 40, generator=seeded(0))
    matches = true_matches(pairs)
    matches[:, :15] = 0
    pose = fit_matches(pairs.source, pairs.target, matches)
    assert error_r_deg(pose.double(), pairs.T_target_source).max() < 0.1


def test_half_a_match_weighs_half() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(1))
    matches = true_matches(pairs)
    half = fit_matches(pairs.source, pairs.target, 0.5 * matches)
    whole = fit_matches(pairs.source, pairs.target, matches)
    torch.testing.assert_close(half, whole, atol=1e-4, rtol=0)


def matchable(n: int = 60, m: int = 45) -> Matchable:
    source = lopsided_clouds(2, n, generator=seeded(12)).double()
    target = lopsided_clouds(2, m, generator=seeded(13)).double()
    g = seeded(14)
    source_features = torch.randn(2, n, 16, generator=g, dtype=torch.float64)
    target_features = torch.randn(2, m, 16, generator=g, dtype=torch.float64)
    alpha = torch.tensor([0.5, 2.0], dtype=torch.float64)
    beta = torch.tensor([0.3, 1.5], dtype=torch.float64)
    return Matchable(source, target, source_features, target_features, alpha, beta)


@pytest.mark.parametrize("iterations", [1, 5])
@pytest.mark.parametrize("block", [1, 45 * 7, 45 * 60])
def test_a_fit_in_blocks_is_the_fit_of_all_matches(
    iterations: int, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = matchable()
    expected = fit_matches(problem.source, problem.target, problem.matches(iterations))
    monkeypatch.setattr(matching, "BLOCK", block)
    with torch.no_grad():
        torch.testing.assert_close(problem.fit(iterations), expected)


def test_a_fit_with_a_graph_passes_gradients_to_the_features() -> None:
    problem = replace(matchable(), source_features=matchable().source_features.requires_grad_())
    torch.autograd.backward(problem.fit(2).square().sum())
    assert problem.source_features.grad is not None
    assert problem.source_features.grad.abs().max() > 0


def test_nothing_grows_with_both_clouds_where_no_graph_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(matching, "BLOCK", 4_000)
    with torch.no_grad(), LargestTensor() as watch:
        matchable(500, 400).fit(5)
    assert (
        watch.entries <= 500 * (16 + 16 + 2) * 2
    )  # features of both clouds; 500 * 400 is 6 times it


def test_a_fit_far_from_the_origin_loses_no_more_digits_than_the_place_itself() -> None:
    pairs, away = made_up_pairs(1, 40, generator=seeded(1)), torch.tensor([64.0, -32.0, 16.0])
    matches = 0.02 + 0.1 * true_matches(pairs)
    here, there = (fit_matches(pairs.source, pairs.target + shift, matches) for shift in (0, away))
    torch.testing.assert_close(there[:, :3, :3], here[:, :3, :3], atol=1e-4, rtol=0)


def test_matched_points_are_the_authors_weighted_means() -> None:
    problem = matchable()
    matches = problem.matches(3)
    weights = matches.sum(dim=-1)
    matched = (matches @ problem.target) / (weights.unsqueeze(-1) + 1e-5)
    expected = fit_rigid(problem.source, matched, weights + 1e-8)
    torch.testing.assert_close(fit_matches(problem.source, problem.target, matches), expected)
