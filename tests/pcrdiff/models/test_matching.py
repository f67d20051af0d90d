"""Soft matches: what they are made of, and the pose that is fitted to them."""

from dataclasses import replace

import pytest
import torch

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.models import matching, sinkhorn
from pcrdiff.models.matching import AnnealingNet, Matchable, fit_matches
from tests.pcrdiff.largest_tensor import LargestTensor
from tests.pcrdiff.synthetic_clouds import (
    lopsided_clouds,
    seeded,
    synthetic_pairs,
    true_matches,
)


def test_a_score_worked_by_hand() -> None:
    features = torch.tensor([[[1.0, 0.0]]]), torch.tensor([[[0.0, 2.0], [1.0, 0.0]]])
    alpha, beta = torch.tensor([3.0]), torch.tensor([0.5])
    scores = Matchable(torch.zeros(1, 1, 3), torch.zeros(1, 2, 3), *features, alpha, beta).scores()
    torch.testing.assert_close(scores, torch.tensor([[[-1.0, 1.5]]]))  # -0.5 (5 - 3), -0.5 (0 - 3)


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


def test_perfect_matches_give_the_pose_also_where_some_points_have_none() -> None:
    pairs = synthetic_pairs(3, 40, generator=seeded(0))
    matches = true_matches(pairs)
    matches[:, :15] = 0
    pose = fit_matches(pairs.source, pairs.target, matches)
    assert error_r_deg(pose.double(), pairs.T_target_source).max() < 0.1


def test_half_a_match_weighs_half() -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(1))
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
    for module in (matching, sinkhorn):
        monkeypatch.setattr(module, "BLOCK", block)
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
    for module in (matching, sinkhorn):
        monkeypatch.setattr(module, "BLOCK", 4_000)
    with torch.no_grad(), LargestTensor() as watch:
        matchable(500, 400).fit(5)
    assert (
        watch.entries <= 500 * (16 + 16 + 2) * 2
    )  # features of both clouds; 500 * 400 is 6 times it


def test_a_fit_far_from_the_origin_loses_no_more_digits_than_the_place_itself() -> None:
    pairs, away = synthetic_pairs(1, 40, generator=seeded(1)), torch.tensor([64.0, -32.0, 16.0])
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
