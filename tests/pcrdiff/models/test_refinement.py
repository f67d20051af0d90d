"""The loop of RPM-Net and EGST: what each update sees, and what it is fitted to."""

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.methods.egst import EGST
from pcrdiff.methods.rpmnet import RPMNet
from pcrdiff.models.losses import inlier_loss, point_loss
from pcrdiff.models.refinement import RefinedMethod, refine, split_normals
from pcrdiff.registration import Normals, Pairs
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs, true_matches

both_methods = pytest.mark.parametrize("kind", [RPMNet, EGST])
Kind = Callable[..., RefinedMethod]
NEIGHBOURS = 8


def make(kind: Kind, normals: Normals = "estimated", updates: int = 3) -> RefinedMethod:
    torch.manual_seed(0)
    return kind(
        feature_dim=16,
        neighbours=NEIGHBOURS,
        radius=0.5,
        train_updates=2,
        updates=updates,
        normals=normals,
    )


def with_normals(pairs: Pairs) -> Pairs:
    """Directions that turn with the cloud, whatever its surface."""
    home = transform(invert(pairs.T_target_source), pairs.target.double())
    directions = [normalize(cloud + 0.3, dim=-1) for cloud in (pairs.source, home)]
    turned = directions[1] @ pairs.T_target_source[:, :3, :3].mT
    return replace(pairs, source_normals=directions[0], target_normals=turned.float())


def test_perfect_matches_give_the_pose_between_the_clouds_where_they_lie() -> None:
    pairs = synthetic_pairs(3, 40, generator=seeded(0))
    matches = true_matches(pairs)
    [(T, used)] = refine(pairs.source, pairs.target, lambda *_: matches, 1)
    assert used is matches
    assert error_r_deg(T.double(), pairs.T_target_source).max() < 0.1
    assert error_t(T.double(), pairs.T_target_source).max() < 1e-3


def test_the_first_update_sees_both_means_in_one_place_and_the_second_the_pose_of_the_first() -> (
    None
):
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    matches = true_matches(pairs)
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
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    matches = true_matches(pairs)
    steps = refine(pairs.source, pairs.target, lambda *_: matches, 3)
    assert len(steps) == 3
    for T, _ in steps[1:]:
        torch.testing.assert_close(T, steps[0][0], atol=1e-5, rtol=0)


def test_a_pose_passes_its_own_gradient_and_none_to_the_next_update() -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(0))
    weights = [torch.rand(1, 40, 40, generator=seeded(k)).requires_grad_() for k in (1, 2)]
    left = iter(weights)
    steps = refine(pairs.source, pairs.target, lambda T, *_: next(left) * T.sum(), 2)
    first, second = torch.autograd.grad(steps[1][0].sum(), weights, allow_unused=True)
    assert first is None
    assert second.abs().max() > 0
    [own] = torch.autograd.grad(steps[0][0].sum(), weights[:1])
    assert own.abs().max() > 0


def test_refuses_to_update_nothing() -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(0))
    with pytest.raises(ValueError, match="at least 1 update, got 0"):
        refine(pairs.source, pairs.target, lambda *_: torch.ones(1, 40, 40), 0)


def test_refuses_clouds_with_other_channels_than_the_normals_ask_for() -> None:
    cloud = torch.zeros(1, 9, 6)
    assert split_normals("x", cloud[..., :3], "estimated")[1] is None
    normals = split_normals("x", cloud, "given")[1]
    assert normals is not None
    assert normals.shape == (1, 9, 3)
    with pytest.raises(ValueError, match="x with estimated normals needs 3 channels, got 6"):
        split_normals("x", cloud, "estimated")
    with pytest.raises(ValueError, match="x with given normals needs 6 channels, got 3"):
        split_normals("x", cloud[..., :3], "given")


@both_methods
def test_the_pose_follows_a_target_and_a_source_that_are_shifted(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(2, 60, generator=seeded(0))
    T_moved_target = small_pose(0, (3.0, -2.0, 1.0)).float().expand(2, 4, 4)
    T_moved_source = small_pose(0, (-1.0, 2.0, 0.5)).float().expand(2, 4, 4)
    before = method.register(pairs.source, pairs.target, generator=seeded(0))
    after = method.register(
        transform(T_moved_source, pairs.source),
        transform(T_moved_target, pairs.target),
        generator=seeded(0),
    )
    torch.testing.assert_close(after @ T_moved_source, T_moved_target @ before, atol=1e-3, rtol=0)


@both_methods
def test_describes_each_cloud_once_and_embeds_the_source_again_at_every_update(kind: Kind) -> None:
    method, pairs = make(kind, updates=4), synthetic_pairs(1, 40, generator=seeded(2))
    embedded: list[Tensor] = []
    method.embedding.register_forward_pre_hook(lambda _, inputs: embedded.append(inputs[0]))
    method.register(pairs.source, pairs.target, generator=seeded(6))
    target, *sources = embedded
    described = method.describe(pairs.target, None)
    torch.testing.assert_close(target, described, atol=1e-5, rtol=0)
    assert len(sources) == 4
    assert not torch.allclose(sources[0], sources[1], atol=1e-3)
    torch.testing.assert_close(sources[0][..., 6:], sources[3][..., 6:])


@both_methods
def test_updates_are_counted_in_training_and_afterwards(
    kind: Kind, monkeypatch: pytest.MonkeyPatch
) -> None:
    method, pairs = make(kind, updates=5), synthetic_pairs(1, 40, generator=seeded(0))
    asked: list[int] = []
    align = method.align

    def watch(source: Tensor, target: Tensor, updates: int) -> object:
        asked.append(updates)
        return align(source, target, updates)

    monkeypatch.setattr(method, "align", watch)
    method.loss(pairs, generator=seeded(0))
    method.register(pairs.source, pairs.target, generator=seeded(0))
    assert asked == [2, 5]


@both_methods
def test_each_update_is_fitted_again_and_the_first_ones_do_not_depend_on_how_many_follow(
    kind: Kind,
) -> None:
    method, pairs = make(kind), synthetic_pairs(2, 40, generator=seeded(0))
    short = method.align(pairs.source, pairs.target, 1)
    long = method.align(pairs.source, pairs.target, 3)
    assert torch.equal(short[0][0], long[0][0])
    assert not torch.allclose(long[0][0], long[1][0], atol=1e-4)


@both_methods
def test_an_earlier_update_weighs_half_in_the_loss(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(2, 40, generator=seeded(0))
    (T_1, matches_1), (T_2, matches_2) = method.align(pairs.source, pairs.target, 2)
    true = transform(pairs.T_target_source.float(), pairs.source)
    points = [point_loss(transform(T, pairs.source), true) for T in (T_1, T_2)]
    inliers = [inlier_loss(matches) for matches in (matches_1, matches_2)]
    terms = method.loss(pairs, generator=seeded(0))
    torch.testing.assert_close(terms["points"], 0.5 * points[0] + points[1])
    torch.testing.assert_close(terms["inliers"], 0.01 * (0.5 * inliers[0] + inliers[1]))


@both_methods
def test_a_few_steps_on_one_batch_find_its_poses(kind: Kind) -> None:
    method, pairs = make(kind), synthetic_pairs(3, 60, generator=seeded(0))
    optimizer = torch.optim.Adam(method.parameters(), lr=5e-3)
    points = []
    for _ in range(25):
        terms = method.loss(pairs, generator=seeded(0))
        points.append(terms["points"].item())
        optimizer.zero_grad()
        torch.autograd.backward(torch.stack(list(terms.values())).sum())
        optimizer.step()
    assert points[-1] < 0.5 * points[0]


@both_methods
def test_given_normals_reach_the_features_and_estimated_ones_take_points_alone(kind: Kind) -> None:
    pairs = with_normals(synthetic_pairs(2, 60, generator=seeded(0)))
    method = make(kind, normals="given")
    source, target = pairs.clouds("given")
    pose = method.register(source, target, generator=seeded(0))
    other = torch.cat([source[..., :3], source[..., 3:].roll(1, dims=-1)], dim=-1)
    assert not torch.allclose(method.register(other, target, generator=seeded(0)), pose)
    assert all(torch.isfinite(x) for x in method.loss(pairs, generator=seeded(0)).values())


@both_methods
def test_refuses_clouds_without_the_normals_it_is_to_be_given(kind: Kind) -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(0))
    with pytest.raises(ValueError, match="with given normals needs 6 channels, got 3"):
        make(kind, normals="given").register(pairs.source, pairs.target, generator=seeded(0))
    with pytest.raises(ValueError, match="the pairs hold no normals"):
        make(kind, normals="given").loss(pairs, generator=seeded(0))


@both_methods
def test_refuses_normals_where_it_estimates_them(kind: Kind) -> None:
    source, target = with_normals(synthetic_pairs(1, 40, generator=seeded(0))).clouds("given")
    with pytest.raises(ValueError, match="with estimated normals needs 3 channels, got 6"):
        make(kind).register(source, target, generator=seeded(0))


@both_methods
def test_refuses_fewer_points_than_neighbours(kind: Kind) -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(2))
    with pytest.raises(
        ValueError, match="needs at least 8 distinct points, got a target cloud of 7"
    ):
        make(kind).register(pairs.source, pairs.target[:, :7], generator=seeded(0))


@both_methods
def test_matches_have_a_row_a_source_point_and_a_column_a_target_point_in_their_order(
    kind: Kind,
) -> None:
    method, pairs = make(kind), synthetic_pairs(2, 60, generator=seeded(0))
    source, target = pairs.source[:, :50], pairs.target
    rows = torch.randperm(50, generator=seeded(1))
    columns = torch.randperm(60, generator=seeded(2))
    [(T, matches)] = method.align(source, target, 1)
    assert matches.shape == (2, 50, 60)
    [(again, shuffled)] = method.align(source[:, rows], target[:, columns], 1)
    torch.testing.assert_close(shuffled, matches[:, rows][:, :, columns], atol=1e-4, rtol=0)
    torch.testing.assert_close(again, T, atol=1e-3, rtol=0)
