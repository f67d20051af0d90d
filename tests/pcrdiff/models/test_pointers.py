"""DCP: where soft pointers lead, and what its two versions share."""

from collections.abc import Callable
from unittest.mock import patch

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.dcp_v1 import DCPv1
from pcrdiff.methods.dcp_v2 import DCPv2
from pcrdiff.models.losses import rotation_loss, translation_loss
from pcrdiff.models.pointers import PointerMethod, fit_pointers
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded, synthetic_pairs

both_versions = pytest.mark.parametrize("kind", [DCPv1, DCPv2])
Kind = Callable[..., PointerMethod]


def make(kind: Kind) -> PointerMethod:
    torch.manual_seed(0)
    return kind(feature_dim=32, neighbours=6)


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
    pairs = synthetic_pairs(3, 30, generator=seeded(10))
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


@both_versions
def test_the_losses_are_those_of_equation_16(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(3, 30, generator=seeded(1))
    terms = method.loss(pairs, generator=seeded(0))
    T = method.register(pairs.source, pairs.target, generator=seeded(0))
    truth = pairs.T_target_source.float()
    assert set(terms) == {"rotation", "translation"}
    torch.testing.assert_close(terms["rotation"], rotation_loss(T, truth))
    torch.testing.assert_close(terms["translation"], translation_loss(T, truth))


@both_versions
def test_the_right_answer_has_no_loss_and_another_one_has(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(2, 30, generator=seeded(0))
    terms = method.loss(pairs, generator=seeded(5))
    assert all(term > 1e-4 for term in terms.values())
    with patch.object(method, "answer", return_value=pairs.T_target_source.float()):
        assert sum(method.loss(pairs, generator=seeded(5)).values()) < 1e-12


@both_versions
def test_draws_nothing(kind: Kind) -> None:
    method, pairs, generator = make(kind), synthetic_pairs(2, 30, generator=seeded(1)), seeded(5)
    before = generator.get_state()
    method.register(pairs.source, pairs.target, generator=generator)
    method.loss(pairs, generator=generator)
    assert torch.equal(generator.get_state(), before)


@both_versions
def test_a_few_steps_on_one_batch_lower_the_loss(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(4, 40, generator=seeded(2))
    optimizer, losses = torch.optim.Adam(method.parameters(), lr=3e-3), []
    for _ in range(30):
        loss = torch.stack(list(method.loss(pairs, generator=seeded(0)).values())).sum()
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.5 * losses[0]
