"""What a comparison comes to, and what is said of the machine."""

import platform
from collections.abc import Callable

import pytest
import torch

from benchmarks.measuring import (
    Comparison,
    alternate,
    compare,
    describe_environment,
    summarise,
)


def test_a_faster_call_has_a_ratio_above_one_whichever_way_it_is_counted() -> None:
    seconds = Comparison("a", [1.0, 2.0, 4.0], [3.0, 8.0, 8.0], "s", higher_is_better=False)
    rates = Comparison("a", [1.0, 0.5, 0.25], [1 / 3, 1 / 8, 1 / 8], "1/s", higher_is_better=True)
    by_seconds, by_rates = compare(seconds, "here"), compare(rates, "here")
    assert by_seconds.ratio == pytest.approx(8.0 / 2.0)  # of the medians
    assert by_rates.ratio == pytest.approx(0.5 / 0.125)
    assert (by_seconds.ours, by_seconds.peer, by_seconds.n) == (2.0, 8.0, 3)
    assert by_seconds.environment == "here"


def test_the_spread_is_that_of_the_ratios_of_what_belongs_together() -> None:
    drifting = Comparison("a", [1.0, 2.0, 3.0], [2.0, 4.0, 6.0], "s", higher_is_better=False)
    assert compare(drifting, "").spread == 0.0
    uneven = Comparison("a", [1.0, 1.0, 1.0], [1.0, 2.0, 3.0], "s", higher_is_better=False)
    assert compare(uneven, "").spread == pytest.approx(1.0)  # quartiles 1.5 and 2.5


def test_sides_of_different_length_are_refused() -> None:
    uneven = Comparison("cf_x", [1.0], [1.0, 2.0], "s", higher_is_better=False)
    with pytest.raises(
        ValueError, match="cf_x needs as many of ours as of the peer's, got 1 and 2"
    ):
        compare(uneven, "")


def test_nothing_has_no_median() -> None:
    with pytest.raises(ValueError, match="at least one value"):
        summarise([])


def test_calls_take_turns_and_the_warm_up_is_not_counted() -> None:
    said: list[str] = []
    calls: list[Callable[[], None]] = [lambda: said.append("a"), lambda: said.append("b")]
    seconds = alternate(calls, repeats=3, warm_up=2)
    assert said == ["a", "b"] * 5
    assert [len(each) for each in seconds] == [3, 3]


def test_the_environment_names_no_host() -> None:
    said = describe_environment()
    parts = said.split("; ")
    assert parts[2] == "1 thread"  # as tests are set up
    assert parts[3] == f"torch {torch.__version__.partition('+')[0]}"
    assert parts[4].endswith("search")
    assert platform.node() not in parts
    assert said == describe_environment()
