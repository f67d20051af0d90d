"""What is particular to EGST: CB's decoder without a noisy pose, looked through twice."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.egst import EGST
from pcrdiff.models.structure import describe
from pcrdiff.registration import Normals
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded, small_pose
from tests.pcrdiff.methods.made_up_methods import make_cb


def make_egst(normals: Normals = "estimated", updates: int = 2) -> EGST:
    torch.manual_seed(0)
    return EGST(
        feature_dim=16,
        neighbours=6,
        radius=0.5,
        train_updates=2,
        updates=updates,
        normals=normals,
    )


def test_one_update_of_centred_clouds_matches_as_cb_does_before_its_pose_encoder_has_learnt() -> (
    None
):
    pairs, cb, egst = made_up_pairs(2, 40, generator=seeded(0)), make_cb(), make_egst()
    source = pairs.source - pairs.source.mean(dim=1, keepdim=True)
    target = pairs.target - pairs.target.mean(dim=1, keepdim=True)
    for name in ("embedding", "attention", "annealing"):
        getattr(egst, name).load_state_dict(getattr(cb, name).state_dict())
    for parameter in cb.pose_encoder.parameters():
        torch.nn.init.zeros_(parameter)
    matches = cb.match(torch.randn(2, 7), torch.tensor([3, 4]), cb.encode(source, target))
    [(_, found)] = egst.align(source, target, 1)
    torch.testing.assert_close(found, matches, atol=1e-4, rtol=1e-3)


def test_the_pose_follows_a_target_and_a_source_that_are_shifted() -> None:
    method, pairs = make_egst(), made_up_pairs(2, 60, generator=seeded(0))
    T_moved_target = small_pose(0, (3.0, -2.0, 1.0)).float().expand(2, 4, 4)
    T_moved_source = small_pose(0, (-1.0, 2.0, 0.5)).float().expand(2, 4, 4)
    before = method.register(pairs.source, pairs.target, generator=seeded(0))
    after = method.register(
        transform(T_moved_source, pairs.source),
        transform(T_moved_target, pairs.target),
        generator=seeded(0),
    )
    torch.testing.assert_close(after @ T_moved_source, T_moved_target @ before, atol=1e-3, rtol=0)


def test_describes_each_cloud_once_and_embeds_the_source_anew_at_every_update() -> None:
    method, pairs = make_egst(updates=4), made_up_pairs(1, 40, generator=seeded(2))
    embedded: list[Tensor] = []
    method.embedding.register_forward_pre_hook(lambda _, inputs: embedded.append(inputs[0]))
    method.register(pairs.source, pairs.target, generator=seeded(6))
    target, *sources = embedded
    torch.testing.assert_close(target, describe(pairs.target, 0.5, 6), atol=1e-5, rtol=0)
    assert len(sources) == 4
    assert not torch.allclose(sources[0], sources[1], atol=1e-3)
    torch.testing.assert_close(sources[0][..., 6:], sources[3][..., 6:])


def test_a_few_steps_on_one_batch_find_its_poses() -> None:
    method, pairs = make_egst(), made_up_pairs(3, 60, generator=seeded(0))
    optimizer = torch.optim.Adam(method.parameters(), lr=5e-3)
    points = []
    for _ in range(25):
        terms = method.loss(pairs, generator=seeded(0))
        assert set(terms) == {"points", "inliers"}
        points.append(terms["points"].item())
        optimizer.zero_grad()
        torch.autograd.backward(torch.stack(list(terms.values())).sum())
        optimizer.step()
    assert points[-1] < 0.5 * points[0]


def test_given_normals_reach_the_matches() -> None:
    pairs = made_up_pairs(2, 60, generator=seeded(0))
    directions = normalize(pairs.source + 0.3, dim=-1), normalize(pairs.target + 0.3, dim=-1)
    pairs = replace(pairs, source_normals=directions[0], target_normals=directions[1])
    other = replace(pairs, source_normals=directions[0].roll(1, dims=-1))
    method = make_egst(normals="given")
    [(_, matches)] = method.align(*pairs.clouds("given"), 1)
    [(_, changed)] = method.align(*other.clouds("given"), 1)
    assert not torch.allclose(matches, changed, rtol=1e-3)


def test_refuses_clouds_without_the_normals_it_is_to_be_given() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(0))
    with pytest.raises(ValueError, match="egst with given normals needs 6 channels, got 3"):
        make_egst(normals="given").register(pairs.source, pairs.target, generator=seeded(0))
    with pytest.raises(ValueError, match="the pairs hold no normals"):
        make_egst(normals="given").loss(pairs, generator=seeded(0))


def test_refuses_fewer_points_than_neighbours() -> None:
    pairs = made_up_pairs(1, 40, generator=seeded(2))
    with pytest.raises(
        ValueError, match="needs at least 6 distinct points, got a target cloud of 5"
    ):
        make_egst().register(pairs.source, pairs.target[:, :5], generator=seeded(0))


def test_matches_have_a_row_a_source_point_and_a_column_a_target_point_in_their_order() -> None:
    method, pairs = make_egst(), made_up_pairs(2, 60, generator=seeded(0))
    source, target = pairs.source[:, :50], pairs.target
    rows = torch.randperm(50, generator=seeded(1))
    columns = torch.randperm(60, generator=seeded(2))
    [(T, matches)] = method.align(source, target, 1)
    assert matches.shape == (2, 50, 60)
    [(again, shuffled)] = method.align(source[:, rows], target[:, columns], 1)
    torch.testing.assert_close(shuffled, matches[:, rows][:, :, columns], atol=1e-4, rtol=0)
    torch.testing.assert_close(again, T, atol=1e-3, rtol=0)
