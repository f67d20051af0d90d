"""Starts that are refined and judged: what the answer is, and what speaks for it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.hypotheses import Refinement, Verifier, refine_and_verify
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, seeded, small_pose

HOW = Refinement(distances=(0.3, 0.1), polish=0.05, truncation=0.08, coarse_points=100, finalists=2)
TRUTH = small_pose(40, (0.3, -0.2, 0.5))


def clouds(n: int = 300) -> tuple[Tensor, Tensor]:
    """A lopsided cloud, and another order of its points under ``TRUTH``."""
    (source,) = lopsided_clouds(1, n, generator=seeded(1))
    order = torch.randperm(n, generator=seeded(2))
    return source, transform(TRUTH.to(source), source)[order]


def turned(degrees: float) -> Tensor:
    """The true pose, turned about the target's centroid."""
    _, target = clouds()
    middle = target.double().mean(dim=0)
    turn = small_pose(degrees, (0.0, 0.0, 0.0))
    turn[:3, 3] = middle - turn[:3, :3] @ middle
    return turn @ TRUTH


def test_one_good_start_among_bad_ones_is_refined_and_answered() -> None:
    starts = torch.stack([turned(150), turned(8), turned(-100)])
    found = refine_and_verify("one", starts, *clouds(), HOW)
    assert error_r_deg(found.T_target_source[None], TRUTH[None]).item() < 1e-3
    assert error_t(found.T_target_source[None], TRUTH[None]).item() < 1e-4
    assert found.residual < 1e-3
    assert found.overlap == 1
    assert found.agreement == pytest.approx(1 / 3)
    assert 0 < found.margin < 1


def test_starts_that_all_lead_there_agree_and_leave_no_other() -> None:
    found = refine_and_verify("one", torch.stack([turned(5), turned(-6)]), *clouds(), HOW)
    assert (found.agreement, found.margin) == (1, 1)


def test_nothing_depends_on_where_the_clouds_lie() -> None:
    source, target = clouds()
    away = small_pose(0, (50.0, -20.0, 10.0))
    moved = transform(away.to(target), target)
    here = refine_and_verify("one", turned(8)[None], source, target, HOW)
    there = refine_and_verify("one", (away @ turned(8))[None], source, moved, HOW)
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
    with_it = refine_and_verify("one", turned(3)[None], *pair, HOW)
    without = refine_and_verify("one", turned(3)[None], *pair, replace(HOW, polish=1e-9))
    assert with_it.residual <= without.residual
