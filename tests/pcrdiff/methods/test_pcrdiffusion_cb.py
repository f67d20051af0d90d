"""What is particular to the correspondence-based method."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.models.matching import Matchable
from tests.pcrdiff.methods.small_methods import WALK, make_cb
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs, true_matches


def match(method: PCRDiffusionCB, x_t: Tensor, t: Tensor, encoded: Matchable) -> Tensor:
    return method.condition(x_t, t, encoded).matches(method.sinkhorn_iterations)


def test_matches_have_a_row_a_source_point_and_a_column_a_target_point() -> None:
    method, pairs = make_cb(), synthetic_pairs(2, 40, generator=seeded(2))
    source, target = pairs.source[:, :30], pairs.target
    x_t, t = torch.randn(2, 7, generator=seeded(3)), torch.tensor([3, 17])
    rows = torch.randperm(30, generator=seeded(4))
    columns = torch.randperm(40, generator=seeded(5))
    matches = match(method, x_t, t, method.encode(source, target))
    assert matches.shape == (2, 30, 40)
    shuffled = match(method, x_t, t, method.encode(source[:, rows], target[:, columns]))
    torch.testing.assert_close(shuffled, matches[:, rows][:, :, columns], atol=1e-4, rtol=0)


def test_the_noisy_pose_and_its_time_reach_the_matches() -> None:
    method, pairs = make_cb(), synthetic_pairs(1, 40, generator=seeded(2))
    clouds = method.encode(pairs.source, pairs.target)
    x_t = torch.randn(1, 7, generator=seeded(3))
    matches = match(method, x_t, torch.tensor([3]), clouds)
    assert not torch.allclose(match(method, x_t + 1, torch.tensor([3]), clouds), matches, rtol=1e-3)
    assert not torch.allclose(match(method, x_t, torch.tensor([19]), clouds), matches, rtol=1e-3)


def test_points_that_are_alike_match_however_little_the_annealing_network_grants() -> None:
    method, pairs = make_cb(), synthetic_pairs(1, 40, generator=seeded(2))
    last = method.annealing.head[-1]
    assert isinstance(last, torch.nn.Linear)
    torch.nn.init.constant_(last.bias, -50.0)
    alpha = method.encode(pairs.source, pairs.target).alpha
    torch.testing.assert_close(alpha, torch.ones(1))


def test_features_do_not_know_where_a_cloud_lies() -> None:
    method, pairs = make_cb().double(), synthetic_pairs(2, 40, generator=seeded(2))
    source, target = pairs.source.double(), pairs.target.double()
    shift = small_pose(0, (3.0, -2.0, 1.0)).expand(2, 4, 4)
    here, there = method.encode(source, target), method.encode(transform(shift, source), target)
    torch.testing.assert_close(here.source_features, there.source_features, atol=1e-6, rtol=0)
    torch.testing.assert_close(here.target_features, there.target_features)


@pytest.mark.parametrize("steps", [1, 4])
def test_describes_each_cloud_once_whatever_the_steps(steps: int) -> None:
    method, times = make_cb(Walk(20, steps, "ddim")), list[int]()
    embedded: list[Tensor] = []
    method.embedding.register_forward_pre_hook(lambda _, inputs: embedded.append(inputs[0]))
    method.pose_encoder.register_forward_pre_hook(lambda _, x: times.append(int(x[1][0])))
    pairs = synthetic_pairs(1, 40, generator=seeded(2))
    method.register(pairs.source, pairs.target, generator=seeded(6))
    assert len(embedded) == 2
    assert times == [20, 15, 10, 5][:steps]


def test_refuses_fewer_points_than_neighbours() -> None:
    pairs = synthetic_pairs(1, 40, generator=seeded(2))
    with pytest.raises(
        ValueError, match="needs at least 6 distinct points, got a target cloud of 5"
    ):
        make_cb().register(pairs.source, pairs.target[:, :5], generator=seeded(0))


def test_the_right_pose_has_no_point_loss_and_inliers_weigh_a_hundredth(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pairs = synthetic_pairs(2, 40, generator=seeded(0))
    matches = 0.5 * true_matches(pairs)
    method = make_cb()
    monkeypatch.setattr(Matchable, "matches", lambda *_: matches)
    terms = method.loss(pairs, generator=seeded(0))
    assert set(terms) == {"diffusion", "points", "inliers"}
    assert terms["diffusion"] < 1e-5
    assert terms["points"] < 1e-3
    # each row and each column falls short by one half
    assert terms["inliers"].item() == pytest.approx(0.01 * (0.5 + 0.5))


def kept_bytes(compute: Callable[[], object], weights: Iterable[Tensor]) -> int:
    """What a graph keeps besides the weights, each storage once."""
    known = {each.untyped_storage().data_ptr() for each in weights}
    kept: dict[int, Tensor] = {}

    def pack(tensor: Tensor) -> Tensor:
        kept[tensor.untyped_storage().data_ptr()] = tensor  # which also keeps the place taken
        return tensor

    with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
        result = compute()
    total = sum(t.untyped_storage().nbytes() for at, t in kept.items() if at not in known)
    del result
    return total


@pytest.mark.parametrize(
    ("batch", "n", "m", "k", "dim"),
    [(2, 200, 200, 4, 8), (1, 300, 150, 16, 64), (3, 90, 120, 8, 32)],
)
def test_a_training_step_keeps_what_the_formula_says(
    batch: int, n: int, m: int, k: int, dim: int
) -> None:
    method = PCRDiffusionCB(WALK, dim, k, 0.4, 5, "quaternion", "raw", "with")
    pairs = synthetic_pairs(batch, max(n, m), generator=seeded(6))
    pairs = replace(pairs, source=pairs.source[:, :n], target=pairs.target[:, :m])
    weights = [*method.parameters()]
    step = kept_bytes(lambda: method.loss(pairs, generator=seeded(7)), weights)
    annealing = kept_bytes(lambda: method.annealing(pairs.source, pairs.target), weights)
    expected = 4 * batch * (n * m + (n + m) * (11 * k + 22 * dim + 24))
    assert abs(step - annealing - expected) < 0.1 * expected
