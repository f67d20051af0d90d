"""What is particular to RPM-Net: pair features that motion leaves, slack, and a second look."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.methods.rpmnet import RPMNet
from pcrdiff.models.losses import inlier_loss, point_loss
from pcrdiff.registration import Normals, Pairs
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded, small_pose


def make_rpmnet(updates: int = 3, normals: Normals = "estimated") -> RPMNet:
    torch.manual_seed(0)
    return RPMNet(
        feature_dim=16,
        neighbours=8,
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


def test_the_pose_follows_a_target_that_is_shifted() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(2, 60, generator=seeded(0))
    T_moved_target = small_pose(0, (3.0, -2.0, 1.0)).float().expand(2, 4, 4)
    moved = transform(T_moved_target, pairs.target)
    before = method.register(pairs.source, pairs.target, generator=seeded(0))
    after = method.register(pairs.source, moved, generator=seeded(0))
    torch.testing.assert_close(after, T_moved_target @ before, atol=1e-3, rtol=0)


def test_a_shifted_source_has_the_pose_that_shifts_it_back() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(2, 60, generator=seeded(0))
    T_moved_source = small_pose(0, (-1.0, 2.0, 0.5)).float().expand(2, 4, 4)
    moved = transform(T_moved_source, pairs.source)
    before = method.register(pairs.source, pairs.target, generator=seeded(0))
    after = method.register(moved, pairs.target, generator=seeded(0))
    torch.testing.assert_close(after @ T_moved_source, before, atol=1e-3, rtol=0)


def test_updates_are_counted_in_training_and_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    method, pairs = make_rpmnet(updates=5), made_up_pairs(1, 40, generator=seeded(0))
    asked: list[int] = []
    align = method.align

    def watch(source: Tensor, target: Tensor, updates: int) -> object:
        asked.append(updates)
        return align(source, target, updates)

    monkeypatch.setattr(method, "align", watch)
    method.loss(pairs, generator=seeded(0))
    method.register(pairs.source, pairs.target, generator=seeded(0))
    assert asked == [2, 5]


def test_each_update_is_fitted_anew_and_the_first_ones_do_not_hang_on_how_many_follow() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(2, 40, generator=seeded(0))
    short = method.align(pairs.source, pairs.target, 1)
    long = method.align(pairs.source, pairs.target, 3)
    assert torch.equal(short[0][0], long[0][0])
    assert not torch.allclose(long[0][0], long[1][0], atol=1e-4)


def test_an_earlier_update_weighs_half_in_the_loss() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(2, 40, generator=seeded(0))
    (T_1, matches_1), (T_2, matches_2) = method.align(pairs.source, pairs.target, 2)
    true = transform(pairs.T_target_source.float(), pairs.source)
    points = [point_loss(transform(T, pairs.source), true) for T in (T_1, T_2)]
    inliers = [inlier_loss(matches) for matches in (matches_1, matches_2)]
    terms = method.loss(pairs, generator=seeded(0))
    torch.testing.assert_close(terms["points"], 0.5 * points[0] + points[1])
    torch.testing.assert_close(terms["inliers"], 0.01 * (0.5 * inliers[0] + inliers[1]))


def test_a_few_steps_on_one_batch_find_its_poses() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(3, 60, generator=seeded(0))
    optimizer = torch.optim.Adam(method.parameters(), lr=5e-3)
    points = []
    for _ in range(25):
        terms = method.loss(pairs, generator=seeded(0))
        points.append(terms["points"].item())
        optimizer.zero_grad()
        torch.autograd.backward(torch.stack(list(terms.values())).sum())
        optimizer.step()
    assert points[-1] < 0.5 * points[0]


def test_given_normals_reach_the_features_and_estimated_ones_take_points_alone() -> None:
    pairs = with_normals(made_up_pairs(2, 60, generator=seeded(0)))
    method = make_rpmnet(normals="given")
    source, target = pairs.clouds("given")
    pose = method.register(source, target, generator=seeded(0))
    other = torch.cat([source[..., :3], source[..., 3:].roll(1, dims=-1)], dim=-1)
    assert not torch.allclose(method.register(other, target, generator=seeded(0)), pose)
    assert all(torch.isfinite(x) for x in method.loss(pairs, generator=seeded(0)).values())


def test_refuses_clouds_without_the_normals_it_is_to_be_given() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(0))
    with pytest.raises(ValueError, match="rpmnet with given normals needs 6 channels, got 3"):
        make_rpmnet(normals="given").register(pairs.source, pairs.target, generator=seeded(0))
    with pytest.raises(ValueError, match="the pairs hold no normals"):
        make_rpmnet(normals="given").loss(pairs, generator=seeded(0))


def test_refuses_normals_where_it_estimates_them() -> None:
    source, target = with_normals(made_up_pairs(1, 40, generator=seeded(0))).clouds("given")
    with pytest.raises(ValueError, match="rpmnet with estimated normals needs 3 channels, got 6"):
        make_rpmnet().register(source, target, generator=seeded(0))


def test_refuses_fewer_points_than_neighbours() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(2))
    with pytest.raises(
        ValueError, match="needs at least 8 distinct points, got a target cloud of 7"
    ):
        make_rpmnet().register(pairs.source, pairs.target[:, :7], generator=seeded(0))


def test_matches_have_a_row_a_source_point_and_a_column_a_target_point_in_their_order() -> None:
    method, pairs = make_rpmnet(), made_up_pairs(2, 60, generator=seeded(0))
    source, target = pairs.source[:, :50], pairs.target
    rows = torch.randperm(50, generator=seeded(1))
    columns = torch.randperm(60, generator=seeded(2))
    [(T, matches)] = method.align(source, target, 1)
    assert matches.shape == (2, 50, 60)
    [(again, shuffled)] = method.align(source[:, rows], target[:, columns], 1)
    torch.testing.assert_close(shuffled, matches[:, rows][:, :, columns], atol=1e-4, rtol=0)
    torch.testing.assert_close(again, T, atol=1e-3, rtol=0)
