"""Contenders: which pairs they register, what is kept of it, and who is compared with whom."""

import pytest
import torch
from torch import Tensor

from benchmarks.registration import Contender, compare_registrations, first_points
from pcrdiff.registration import LearnedMethod, Method, Pairs


class Shifts(Method):
    """Answers the shift of the first point; fails on pairs that it is told to fail on."""

    least_points = 1

    def __init__(self, name: str, fails_on: float = -1.0) -> None:
        self.name, self.fails_on = name, fails_on

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """Answer every pair, or raise."""
        del generator
        if (source[:, 0, 0] == self.fails_on).any():
            raise ValueError("told to")
        T = torch.eye(4).repeat(len(source), 1, 1)
        T[:, :3, 3] = target[:, 0] - source[:, 0]
        return T


class LearnedShifts(LearnedMethod):
    """The same for a method that takes many at once."""

    least_points = 1

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name, self.seen = name, list[int]()

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """Answer, and note how many pairs came at once."""
        self.seen.append(len(source))
        return Shifts(self.name).answer(source, target, generator=generator)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> dict[str, Tensor]:
        """Nothing to learn."""
        del pairs, generator
        return {}


def shifted_pairs(count: int = 6, points: int = 8) -> Pairs:
    """Pair k: the first point at k, the target one length further along y."""
    source = torch.arange(count)[:, None, None] * torch.ones(1, points, 3)
    T = torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    T[:, 1, 3] = 1.0
    target = source + torch.tensor([0.0, 1.0, 0.0])
    return Pairs(source, target, T, torch.arange(count), ("shape",) * count)


def test_a_slow_method_has_other_pairs_in_every_round() -> None:
    contender = Contender(Shifts("slow"), "paper", shifted_pairs(), share=2)
    for turn in range(4):  # the fourth starts over
        contender.run(turn)
    assert {k: len(each) for k, each in contender.ms.items()} == dict.fromkeys(range(6), 1) | {
        0: 2,
        1: 2,
    }
    row = contender.row("here")
    assert (row.n, row.batch, row.failures, row.error_t) == (6, 2, 0, 0.0)


def test_a_pair_that_a_method_fails_on_is_scored_as_the_identity() -> None:
    contender = Contender(Shifts("failing", fails_on=2.0), "paper", shifted_pairs(), share=6)
    contender.run(0)
    row = contender.row("here")
    assert row.failures == 1
    assert row.error_t == pytest.approx(1 / 6)
    assert row.n == 6


def test_only_a_learned_method_is_given_its_pairs_at_once() -> None:
    method = LearnedShifts("learned")
    contender = Contender(method, "paper", shifted_pairs(), share=6)
    contender.run(0)
    assert method.seen == [1, 1, 1, 1, 1, 1, 6]
    assert contender.row("here").batch == 6
    assert len(contender.rates) == 1


def taken(
    name: str, ms: dict[int, float], rates: list[float], points: int = 8, learned: bool = True
) -> Contender:
    method = LearnedShifts(name) if learned else Shifts(name)
    pairs = first_points(shifted_pairs(), points)
    times = {k: [value] for k, value in ms.items()}
    return Contender(method, "paper", pairs, ms=times, rates=rates)


def test_cf_is_compared_with_the_fastest_that_looks_at_the_clouds() -> None:
    contenders = [
        taken("identity", {0: 0.1, 1: 0.1}, [1e5], learned=False),
        taken("icp_centroid", {0: 30.0, 1: 30.0}, [30.0, 40.0], learned=False),
        taken("small_gicp", {0: 20.0, 1: 22.0}, [50.0], learned=False),
        taken("pcrdiffusion_cf", {0: 5.0, 1: 6.0, 2: 9.0}, [300.0, 500.0]),
        taken("pcrdiffusion_cf", {0: 2.0, 1: 2.0}, [900.0], points=4),
        taken("pcrdiffusion_cb", {0: 50.0, 1: 60.0, 2: 70.0}, [20.0]),
        taken("rpmnet", {1: 300.0}, [3.0]),
        taken("rpmnet", {1: 500.0}, [2.0]),
    ]
    found = {each.name: each for each in compare_registrations(contenders)}
    assert found["cf_latency_vs_fastest_peer"].ours == [5.0, 6.0]
    assert found["cf_latency_vs_fastest_peer"].peer == [20.0, 22.0]
    assert found["cf_first_4_points_latency_vs_fastest_peer"].ours == [2.0, 2.0]
    assert found["cf_throughput_vs_icp"].peer == [30.0, 40.0]
    assert found["cf_throughput_vs_icp"].higher_is_better
    assert (found["cb_latency_vs_rpmnet"].ours, found["cb_latency_vs_rpmnet"].peer) == (
        [60.0],
        [500.0],
    )
    assert "cf_latency_vs_identity_paper" not in found


def test_sides_without_a_common_pair_are_refused() -> None:
    contenders = [
        taken("pcrdiffusion_cb", {0: 1.0}, [1.0]),
        taken("rpmnet", {1: 1.0}, [1.0]),
    ]
    with pytest.raises(ValueError, match="cb_latency_vs_rpmnet needs pairs that both registered"):
        compare_registrations(contenders)
