"""Shares of the machine's rates, worked by hand."""

import pytest
from torch import nn

from benchmarks.ceilings import Work, linear_flop, measure_ceilings, row
from benchmarks.effort import DRY
from benchmarks.measuring import Summary


def test_a_share_is_what_was_reached_of_the_machines_rate() -> None:
    work = Work("a loop", lambda: None, flop=4e9, traffic=1e9)
    found = row(work, Summary(0.5, 0.1, 7), gemm=80e9, copy=8e9, environment="here")
    assert (found.gflop_per_s, found.gbyte_per_s) == (8.0, 2.0)
    assert (found.gflop_share, found.gbyte_share) == (0.1, 0.25)
    assert (found.ms, found.spread_ms, found.n) == (500.0, 100.0, 7)


def test_a_linear_layer_costs_a_product_and_a_sum_a_weight() -> None:
    network = nn.Sequential(nn.Linear(3, 4), nn.ReLU(), nn.Linear(4, 5))
    assert linear_flop(network, rows=10) == 2 * 10 * (3 * 4 + 4 * 5)


def test_the_machine_sets_the_ceiling_and_every_loop_is_below_nothing_else() -> None:
    found = measure_ceilings(DRY, "here")
    machine = [each for each in found if each.kind == "machine"]
    assert max(
        e.gflop_share for e in machine if e.name.endswith(" float32 product")
    ) == pytest.approx(1.0)
    assert [each.gbyte_share for each in machine if each.name == "copy"] == [pytest.approx(1.0)]
    loops = {each.name.partition(",")[0] for each in found if each.kind == "loop"}
    assert loops == {"PointNet", "chamfer", "CB", "Sinkhorn"}
    assert all(each.ms > 0 and each.n == 1 for each in found)
