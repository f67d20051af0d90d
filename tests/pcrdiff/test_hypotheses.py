"""Starts that are refined and judged: what the answer is, and what speaks for it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.hypotheses import Fit, Refinement, Search, Verified, Verifier
from pcrdiff.methods.gicp_multistart import GICPMultistart
from pcrdiff.registration import EVIDENCE
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, seeded, small_pose

HOW = Refinement(distances=(0.3, 0.1), polish=0.05, truncation=0.08, coarse_points=100, finalists=2)
TRUTH = small_pose(40, (0.3, -0.2, 0.5))


def clouds(n: int = 300) -> tuple[Tensor, Tensor]:
    """A lopsided cloud, and another order of its points under ``TRUTH``."""
    (source,) = lopsided_clouds(1, n, generator=seeded(1))
    order = torch.randperm(n, generator=seeded(2))
    return source, transform(TRUTH.to(source), source)[order]


def verified(starts: Tensor, source: Tensor, target: Tensor, how: Refinement) -> Verified:
    return Search(starts, source, target, how).judge("one", len(starts))


def turned(degrees: float) -> Tensor:
    """The true pose, turned about the target's centroid."""
    _, target = clouds()
    middle = target.double().mean(dim=0)
    turn = small_pose(degrees, (0.0, 0.0, 0.0))
    turn[:3, 3] = middle - turn[:3, :3] @ middle
    return turn @ TRUTH


def test_one_good_start_among_bad_ones_is_refined_and_answered() -> None:
    starts = torch.stack([turned(150), turned(8), turned(-100)])
    found = verified(starts, *clouds(), HOW)
    assert error_r_deg(found.T_target_source[None], TRUTH[None]).item() < 1e-3
    assert error_t(found.T_target_source[None], TRUTH[None]).item() < 1e-4
    assert found.residual < 1e-3
    assert found.overlap == 1
    assert found.agreement == pytest.approx(1 / 3)
    assert 0 < found.margin < 1


def test_starts_that_all_lead_there_agree_and_leave_no_other() -> None:
    found = verified(torch.stack([turned(5), turned(-6)]), *clouds(), HOW)
    assert (found.agreement, found.margin) == (1, 1)


def test_nothing_depends_on_where_the_clouds_lie() -> None:
    source, target = clouds()
    away = small_pose(0, (50.0, -20.0, 10.0))
    moved = transform(away.to(target), target)
    here = verified(turned(8)[None], source, target, HOW)
    there = verified((away @ turned(8))[None], source, moved, HOW)
    back = invert(away) @ there.T_target_source
    torch.testing.assert_close(back, here.T_target_source, atol=1e-4, rtol=0)
    assert there.residual == pytest.approx(here.residual, abs=1e-3)


def test_a_point_without_counterpart_costs_the_truncation_and_no_more() -> None:
    source, _ = (cloud.double().numpy() for cloud in clouds())
    far = np.vstack([source, source[:100] + 9.0])
    fit = Verifier(source, far, HOW).fit(np.eye(4))
    assert fit.residual == pytest.approx(100 / 700)
    assert fit.overlap == pytest.approx(600 / 700)


def test_the_polish_is_kept_only_where_it_fits_better() -> None:
    source, target = clouds()
    noise = 0.01 * torch.randn(target.shape, generator=seeded(3))
    pair = source, target + noise
    with_it = verified(turned(3)[None], *pair, HOW)
    without = verified(turned(3)[None], *pair, replace(HOW, polish=1e-9))
    assert with_it.residual <= without.residual


def tube(turns: int, length: float) -> np.ndarray:
    """Rings of points about z, each point a tenth of the length from the next ring's."""
    angles = np.linspace(0, 2 * np.pi, turns, endpoint=False)
    z = np.linspace(-length / 2, length / 2, 11)
    rings = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles)], axis=1)
    return np.vstack([np.column_stack([rings, np.full(turns, height)]) for height in z])


def sharpness(points: np.ndarray) -> float:
    """Of a cloud laid on itself."""
    verifier = Verifier(points, points, HOW)
    return verifier.sharpness(verifier.fit(np.eye(4)))


def test_a_shape_that_turns_or_slides_on_itself_determines_no_pose() -> None:
    assert sharpness(tube(36, 2.0)) < 1e-9  # ten degrees from point to point
    sliding = Verifier(tube(9, 9.0)[9:-9], tube(9, 9.0), HOW)  # shorter, and in steps of 0.9
    assert sliding.sharpness(sliding.fit(np.eye(4))) > 0.5
    source, _ = (cloud.double().numpy() for cloud in clouds())
    assert sharpness(source - source.mean(axis=0)) > 0.2


def test_sharpness_is_what_the_cheapest_step_away_costs() -> None:
    grid = np.stack(np.meshgrid(*[np.arange(n) * 0.1 for n in (12, 5, 3)]), axis=-1).reshape(-1, 3)
    grid -= grid.mean(axis=0)
    verifier = Verifier(grid, grid, HOW)
    # along the longest axis, a tenth, all points but one layer of twelve fall on others
    assert verifier.sharpness(verifier.fit(np.eye(4))) == pytest.approx(1 / 12)
    worse = verifier.fit(np.eye(4)).residual + 0.05
    told = verifier.sharpness(Fit(np.eye(4), worse, 1.0))
    assert told == pytest.approx(1 / 12 - 0.05)


def test_close_points_lie_within_a_third_of_the_truncation() -> None:
    points = np.random.default_rng(0).permutation(np.mgrid[:5, :5, :5].reshape(3, -1).T * 1.0)
    verifier = Verifier(points, points, HOW)
    for away, close in ((0.0, 1.0), (0.026, 1.0), (0.027, 0.0), (0.079, 0.0)):
        T = np.eye(4)
        T[0, 3] = away
        assert verifier.close(T) == close
        assert verifier.fit(T).overlap == 1


def test_evidence_is_named_in_the_order_of_its_numbers() -> None:
    found = verified(torch.stack([turned(8), turned(150)]), *clouds(), HOW)
    assert found.evidence.tolist() == [getattr(found, name) for name in EVIDENCE]
    assert {*EVIDENCE} == {*Verified.__dataclass_fields__} - {"T_target_source"}
    assert found.close == 1
    assert found.sharpness > 0.1


def multistart() -> GICPMultistart:
    return GICPMultistart(TRUTH[None], starts=2, refinement=HOW)


def test_verify_gives_the_answer_that_register_gives() -> None:
    source, target = clouds()
    found = multistart().verify(source, target, generator=seeded(0))
    answered = multistart().register(source[None], target[None], generator=seeded(0))
    assert torch.equal(found.T_target_source, answered[0])


@pytest.mark.parametrize("points", [0, 2])
def test_verify_refuses_the_clouds_that_register_refuses(points: int) -> None:
    source, target = clouds()
    refused = f"at least 3 distinct points, got a .* of {points}"
    with pytest.raises(ValueError, match=refused):
        multistart().register(source[None], target[None, :points], generator=seeded(0))
    with pytest.raises(ValueError, match=refused):
        multistart().verify(source, target[:points], generator=seeded(0))


class Learning(GICPMultistart):
    """Says whether it was asked for starts where gradients are kept."""

    def propose(
        self, source: Tensor, target: Tensor, count: int, *, generator: torch.Generator
    ) -> Tensor:
        """As it always does."""
        self.kept = torch.is_grad_enabled()
        return super().propose(source, target, count, generator=generator)


def test_verify_keeps_no_gradient() -> None:
    method = Learning(TRUTH[None], starts=1, refinement=HOW)
    method.verify(*clouds(), generator=seeded(0))
    assert not method.kept
    assert torch.is_grad_enabled()
