"""What is particular to the method that sees where the noisy pose lays the source."""

from dataclasses import replace

import pytest
import torch

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.pcrdiffusion_cb_moved import PCRDiffusionCBMoved, between_centroids, earlier
from pcrdiff.registration import Pairs
from tests.pcrdiff.methods.small_methods import OWN_WALK, make_moved
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, synthetic_pairs


def make() -> PCRDiffusionCBMoved:
    return make_moved(PCRDiffusionCBMoved, sinkhorn_iterations=5)


def pairs() -> Pairs:
    return synthetic_pairs(2, 80, generator=seeded(0))


def test_a_step_sees_only_where_the_pose_lays_the_source() -> None:
    """The source moved by A under the pose G is the source under G A, but for the context."""
    method, given = make().double(), pairs()
    for layer in method.attention:  # which sees the clouds as they are
        torch.nn.init.zeros_(layer.get_parameter("norm_feed.weight"))
        torch.nn.init.zeros_(layer.get_parameter("norm_feed.bias"))
    A, G = random_poses(2, generator=seeded(1)), random_poses(2, generator=seeded(2))
    A[:, :3, 3] = 0
    source, target = given.source.double(), given.target.double()
    t = torch.tensor([7, 7])
    here = method.encode(source, target)
    there = method.encode(transform(A, source), target)
    features = method.matchable(method.space.encode(G @ A), t, here).source_features
    moved = method.matchable(method.space.encode(G), t, there).source_features
    torch.testing.assert_close(moved, features, atol=1e-6, rtol=0)


def test_the_answer_follows_the_clouds_wherever_they_lie() -> None:
    method, given, shift = make(), pairs(), torch.tensor([5.0, -3.0, 2.0])
    here = method.register(given.source, given.target, generator=seeded(1))
    there = method.register(given.source, given.target + shift, generator=seeded(1))
    torch.testing.assert_close(there[:, :3, 3], here[:, :3, 3] + shift, atol=1e-4, rtol=0)
    torch.testing.assert_close(there[:, :3, :3], here[:, :3, :3], atol=1e-4, rtol=0)


def test_poses_about_the_centroids_carry_the_same_points() -> None:
    given = pairs()
    source, target = given.source.double(), given.target.double()
    means = source.mean(dim=1), target.mean(dim=1)
    T = between_centroids(given.T_target_source, *means)
    moved = transform(T, source - means[0].unsqueeze(1)) + means[1].unsqueeze(1)
    torch.testing.assert_close(moved, transform(given.T_target_source, source))
    back = between_centroids(T, -means[0], -means[1])
    torch.testing.assert_close(back, given.T_target_source)


def test_the_time_reaches_the_sharpness_of_the_matches() -> None:
    method, given = make(), pairs()
    encoded, x = method.encode(given.source, given.target), torch.zeros(2, method.space.dim)
    early, late = (method.matchable(x, torch.full((2,), t), encoded) for t in (2, 19))
    assert not torch.allclose(early.beta, late.beta)


def test_certain_matches_outweigh_the_others() -> None:
    """One point of a pair is matched to everything, which bends a plain fit."""
    method, given = make(), pairs()
    encoded = method.encode(given.source, given.target)
    matchable = method.matchable(torch.zeros(2, method.space.dim), torch.tensor([5, 5]), encoded)
    order = torch.cdist(
        transform(given.T_target_source.float(), given.source), given.target
    ).argmin(dim=-1)
    scores = torch.full((2, 80, 80), -20.0)
    scores.scatter_(2, order.unsqueeze(-1), 5.0)
    scores[:, :20] = -1.0

    class Fixed(type(matchable)):  # type: ignore[misc]
        def scores(self) -> torch.Tensor:
            return scores

    fixed = Fixed(**vars(replace(matchable)))
    T, matches = method.fit(fixed)
    assert matches[:, :20].amax() < 0.5
    truth = between_centroids(
        given.T_target_source, encoded.source_mean.double(), encoded.target_mean.double()
    )
    assert error_r_deg(T.double(), truth).max() < 2


def test_a_walk_in_training_goes_to_an_earlier_time() -> None:
    t = torch.tensor([20, 20, 20, 1])
    for seed in range(20):
        found = earlier(t, generator=seeded(seed))
        assert (found >= 1).all()
        assert (found[:3] <= 14).all()


def test_every_second_walk_in_training_begins_in_the_mode() -> None:
    method = make()
    x, t = method.beginnings(torch.ones(4, method.space.dim), generator=seeded(1))
    assert (x[::2] == 0).all()
    assert (x[1::2] != 0).all()
    assert t.tolist() == [OWN_WALK.timesteps] * 4


def test_looks_at_few_points_of_a_large_cloud_and_at_all_of_a_small_one() -> None:
    large = synthetic_pairs(1, 1300, generator=seeded(0))
    encoded = make().encode(large.source, large.target)
    seen = encoded.source.points + encoded.source_mean.unsqueeze(1)
    assert seen.shape == (1, 512, 3)
    assert torch.cdist(seen.double(), large.source.double()).amin(dim=-1).max() < 1e-5
    assert make().encode(pairs().source, pairs().target).target.points.shape == (2, 80, 3)


def test_refuses_fewer_points_than_a_patch_has() -> None:
    given = pairs()
    with pytest.raises(ValueError, match="needs at least 16 distinct points, got a target cloud"):
        make().register(given.source, given.target[:, :15], generator=seeded(0))
