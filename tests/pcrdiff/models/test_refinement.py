"""The loop of RPM-Net: what each update sees, and what it is fitted to."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.refinement import refine
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded


def true_matches(count: int, n: int, seed: int = 0) -> Tensor:
    """1 where the target point is the moved source point."""
    pairs = made_up_pairs(count, n, generator=seeded(seed))
    moved = transform(pairs.T_target_source, pairs.source.double())
    matches = (torch.cdist(moved, pairs.target.double()) < 1e-5).float()
    assert (matches.sum(dim=-1) == 1).all()
    return matches


def test_perfect_matches_give_the_pose_between_the_clouds_where_they_lie() -> None:
    pairs, matches = made_up_pairs(3, 40, generator=seeded(0)), true_matches(3, 40)
    [(T, used)] = refine(pairs.source, pairs.target, lambda *_: matches, 1)
    assert used is matches
    assert error_r_deg(T.double(), pairs.T_target_source).max() < 0.1
    assert error_t(T.double(), pairs.T_target_source).max() < 1e-3


def test_the_first_update_sees_both_means_in_one_place_and_the_second_the_pose_of_the_first() -> (
    None
):
    pairs, matches = made_up_pairs(2, 40, generator=seeded(0)), true_matches(2, 40)
    seen: list[tuple[Tensor, Tensor, Tensor]] = []

    def match(T: Tensor, moved: Tensor, fixed: Tensor) -> Tensor:
        seen.append((T, moved, fixed))
        return matches

    refine(pairs.source, pairs.target, match, 2)
    (T_start, start, fixed), (T_again, again, fixed_again) = seen
    assert torch.equal(T_start, torch.eye(4).expand(2, 4, 4))
    torch.testing.assert_close(start.mean(dim=1), torch.zeros(2, 3), atol=1e-6, rtol=0)
    torch.testing.assert_close(fixed.mean(dim=1), torch.zeros(2, 3), atol=1e-6, rtol=0)
    assert torch.equal(fixed, fixed_again)
    torch.testing.assert_close(again, transform(T_again, start))
    torch.testing.assert_close(again, matches @ fixed, atol=1e-4, rtol=0)


def test_each_pose_is_fitted_to_the_source_as_it_was_given() -> None:
    pairs, matches = made_up_pairs(2, 40, generator=seeded(0)), true_matches(2, 40)
    steps = refine(pairs.source, pairs.target, lambda *_: matches, 3)
    assert len(steps) == 3
    for T, _ in steps[1:]:
        torch.testing.assert_close(T, steps[0][0], atol=1e-5, rtol=0)


def test_a_pose_passes_its_own_gradient_and_none_to_the_next_update() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(0))
    weights = [torch.rand(1, 40, 40, generator=seeded(k)).requires_grad_() for k in (1, 2)]
    left = iter(weights)
    steps = refine(pairs.source, pairs.target, lambda T, *_: next(left) * T.sum(), 2)
    first, second = torch.autograd.grad(steps[1][0].sum(), weights, allow_unused=True)
    assert first is None
    assert second.abs().max() > 0
    [own] = torch.autograd.grad(steps[0][0].sum(), weights[:1])
    assert own.abs().max() > 0


def test_refuses_to_update_nothing() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(0))
    with pytest.raises(ValueError, match="at least 1 update, got 0"):
        refine(pairs.source, pairs.target, lambda *_: torch.ones(1, 40, 40), 0)
