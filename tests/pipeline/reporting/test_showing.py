"""How numbers and budgets are printed."""

import pandas as pd
import pytest

from pipeline.reporting.paper import place
from pipeline.reporting.reading import Training
from pipeline.reporting.showing import describe_budget, show_bound, show_short, show_value, unit_of


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (23.15478, "23.1548"), (0.00005, "0.0001"), (2e-6, "2e-06")]
)
def test_prints_numbers_as_the_paper_does_without_hiding_small_ones(
    value: float, text: str
) -> None:
    assert show_value("error_t", value) == show_value("error_r_deg", value) == text


@pytest.mark.parametrize("metric", ["error_r_deg", "mae_r_deg", "spread_over_draws_deg"])
def test_an_angle_below_what_arithmetic_resolves_says_so(metric: str) -> None:
    assert show_value(metric, 9.9e-7) == show_bound(metric, -4e-8) == "< 1e-6"
    assert show_value(metric, 1e-6) == "1e-06"
    assert show_value("error_t", 4e-8) == show_bound("error_t", 4e-8) == "4e-08"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0"), (123456.0, "1.23e+05"), (123.4, "123"), (12.34, "12.3"), (1.234, "1.23"),
     (0.1234, "0.123"), (0.0001234, "1e-04"), (-1.234, "-1.23")],
)  # fmt: skip
def test_a_bound_has_about_three_digits(value: float, text: str) -> None:
    assert show_short(value) == show_bound("error_t", value) == text


def test_percentages_and_memory_have_one_decimal_and_units_follow_the_metric() -> None:
    assert show_value("below_5_deg_percent", 98.333) == "98.3"
    assert show_value("peak_memory_mib", 41.25) == "41.2"
    units = {"error_t": "m", "mae_r_deg": "deg", "below_5_deg_percent": "%", "seconds": "s"}
    units["peak_memory_mib"] = "MiB"
    assert {metric: unit_of(metric, "m") for metric in units} == units


TITLE = place("modelnet40-rpm").title


def budget(**told: int | str) -> str:
    return describe_budget(Training("kitti", "pcrnet", told, pd.DataFrame()))


def test_a_budget_reads_as_words() -> None:
    assert budget(epochs=1, steps=1200, best_epoch=3) == "1 epoch, 1,200 steps, best epoch 3"
    assert budget(train_pairs=64, epoch_pairs=64) == "64 pairs"
    assert budget(train_pairs=64, epoch_pairs=32) == "64 pairs, 32 of them an epoch"
    assert budget() == "budget not recorded"
    started = budget(epochs=2, start="modelnet40-rpm")
    assert started == f"started from the network of {TITLE} that came with the code, 2 epochs"
