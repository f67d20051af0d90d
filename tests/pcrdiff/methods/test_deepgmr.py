"""What is particular to DeepGMR: mixtures, and one alignment of them."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import from_parts, invert, transform
from pcrdiff.methods.deepgmr import DeepGMR, Mixture, align
from pcrdiff.registration import Pairs
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded, synthetic_pairs


def make_method() -> DeepGMR:
    torch.manual_seed(0)
    return DeepGMR(neighbours=8, feature_dim=32, components=8)


def synthetic_mixtures(
    components: int = 6, *, generator: torch.Generator
) -> tuple[Mixture, Mixture]:
    """Two mixtures that have nothing to do with each other, in float64."""

    def mixture() -> Mixture:
        shares, variances = torch.rand(2, 3, components, generator=generator).double() + 0.1
        means = torch.randn(3, components, 3, generator=generator).double()
        return Mixture(shares.requires_grad_(), means.requires_grad_(), variances.requires_grad_())

    return mixture(), mixture()


# ---- mixtures


def test_a_mixture_is_made_of_shares_means_and_variances() -> None:
    method, cloud = make_method(), lopsided_clouds(2, 50, generator=seeded(0))
    gamma, mixture = method.assign(cloud), method.mix(cloud)
    torch.testing.assert_close(gamma.sum(dim=-1), torch.ones(2, 50))
    for item in range(2):
        for j in range(8):
            g, points = gamma[item, :, j].detach(), cloud[item]
            mean = (g[:, None] * points).sum(0) / g.sum()
            spread = (g * (points - mean).square().sum(-1)).sum() / g.sum()
            torch.testing.assert_close(mixture.shares[item, j], g.mean())
            torch.testing.assert_close(mixture.means[item, j], mean, atol=1e-5, rtol=0)
            torch.testing.assert_close(mixture.variances[item, j], spread, atol=1e-5, rtol=1e-4)


def test_a_component_that_no_point_belongs_to_does_no_harm() -> None:
    method, pairs = make_method(), synthetic_pairs(2, 50, generator=seeded(0))
    with torch.no_grad():
        list(method.head.parameters())[-1][3] = -200.0
    terms = method.loss(pairs, generator=seeded(0))
    torch.autograd.backward(torch.stack(list(terms.values())).sum())
    for parameter in method.parameters():
        assert parameter.grad is not None
        assert torch.isfinite(parameter.grad).all()
    answer = method.register(pairs.source, pairs.target, generator=seeded(0))
    assert error_r_deg(answer.double(), pairs.T_target_source).max() < 0.5


# ---- alignment


def test_aligning_weighs_by_the_sources_shares_and_the_targets_variances() -> None:
    source, target = synthetic_mixtures(generator=seeded(0))
    T = align(source, target).detach()

    def cost(pose: Tensor) -> Tensor:
        squares = (transform(pose, source.means) - target.means).square().sum(dim=-1)
        return (source.shares / target.variances * squares).sum(dim=-1)

    small = torch.randn(40, 3, 3, generator=seeded(1)).double() * 1e-3
    for skew in torch.linalg.matrix_exp(small - small.mT):
        nudge = from_parts(skew, torch.zeros(3).double())
        assert (cost(nudge @ T) > cost(T)).all()


def test_the_gradient_is_finite_where_all_rotations_are_equally_near() -> None:
    corners = torch.cartesian_prod(*[torch.tensor([-1.0, 1.0])] * 3).unsqueeze(0)
    means, even = corners.clone().requires_grad_(), torch.ones(1, 8)
    weights = torch.randn(1, 4, 4, generator=seeded(0))
    T = align(Mixture(even, means, even), Mixture(even, corners, even))
    (gradient,) = torch.autograd.grad((T * weights).sum(), means)
    assert torch.isfinite(gradient).all()
    assert gradient.abs().max() > 0


# ---- the method


def test_solves_exact_copies_before_any_training() -> None:
    pairs = synthetic_pairs(4, 200, generator=seeded(0))
    answer = make_method().register(pairs.source, pairs.target, generator=seeded(0))
    assert error_r_deg(answer.double(), pairs.T_target_source).max() < 0.1
    assert error_t(answer.double(), pairs.T_target_source).max() < 1e-3


def test_the_answer_follows_any_motion_of_the_target() -> None:
    pairs, other = (synthetic_pairs(3, 200, generator=seeded(k)) for k in (1, 2))
    method, A = make_method().double(), random_poses(3, generator=seeded(3))
    source, target = pairs.source.double(), other.target.double()  # no copies: nothing is exact
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(source, transform(A, target), generator=seeded(0))
    torch.testing.assert_close(moved, A @ answer, atol=1e-6, rtol=0)


def test_there_and_back_are_compared_with_the_truth() -> None:
    pairs = synthetic_pairs(3, 100, generator=seeded(0))
    method = make_method()
    assert sum(method.loss(pairs, generator=seeded(0)).values()) < 1e-5
    wrong = Pairs(
        pairs.source, pairs.target, invert(pairs.T_target_source), pairs.item, pairs.group
    )
    terms = method.loss(wrong, generator=seeded(0))
    T = pairs.T_target_source
    eye = torch.eye(4, dtype=torch.float64)
    there = (T @ T - eye).square().mean().item()
    back = (invert(T) @ invert(T) - eye).square().mean().item()
    assert terms["there"].item() == pytest.approx(there, abs=1e-3)
    assert terms["back"].item() == pytest.approx(back, abs=1e-3)
