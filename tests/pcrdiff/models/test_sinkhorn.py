"""Sinkhorn's iterations: against a slow twin, and where they must lead."""

import pytest
import torch
from torch import Tensor

from pcrdiff.models import sinkhorn as module
from pcrdiff.models.sinkhorn import sinkhorn, sinkhorn_product
from tests.pcrdiff.synthetic_clouds import seeded


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


@pytest.mark.parametrize("block", [1, 9 * 3, 9 * 7])
def test_the_product_in_blocks_is_that_with_the_matches(
    block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = torch.randn(7, 4, generator=seeded(4), dtype=torch.float64)
    right = torch.randn(9, 4, generator=seeded(5), dtype=torch.float64)
    values = torch.randn(9, 3, generator=seeded(6), dtype=torch.float64)
    monkeypatch.setattr(module, "BLOCK", block)
    expected = sinkhorn((left @ right.mT)[None], 5)[0] @ values
    torch.testing.assert_close(sinkhorn_product(left, right, values, 5), expected)
