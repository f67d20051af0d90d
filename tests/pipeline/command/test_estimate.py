"""What trainings will cost: counted from params and data, timed on random clouds."""

from pathlib import Path

import pytest

from pipeline.command import estimate as estimating
from pipeline.command.estimate import Estimate, estimate, step_seconds, told, training_pairs
from pipeline.settings.params import Params, read_params
from tests.tiny import CB, CF, SCENARIO


@pytest.fixture
def params(blank: Path, monkeypatch: pytest.MonkeyPatch) -> Params:
    """Those of a project with nothing done, whose steps are timed once."""
    monkeypatch.setattr(estimating, "SECONDS", 0.0)
    return read_params(blank / "params.yaml")


def test_each_training_is_named_with_its_steps(params: Params, blank: Path) -> None:
    found = list(estimate(params, blank))
    steps = {(one.method, one.scenario): one.steps for one in found}
    assert steps == {
        (CF, SCENARIO): 3 * 2,  # six pairs in batches of four
        (CB, SCENARIO): 3 * 2,
        ("pcrnet", SCENARIO): 1 * 2,
        ("rpmnet", SCENARIO): 1 * 2,
        (CF, SCENARIO + VARIANTS.format(7)): 7 * 2 * 2,
        (CB, SCENARIO + VARIANTS.format(5)): 5 * 2 * 2,
    }
    assert all(one.seconds > 0 for one in found)


VARIANTS = ", {} variants"


def test_pairs_are_those_that_the_scenario_asks_for_or_what_the_data_has(
    params: Params, blank: Path
) -> None:
    assert training_pairs(params, SCENARIO, blank) == 6
    made = params.scenarios[SCENARIO]
    more = made.model_copy(update={"pairs": made.pairs.model_copy(update={"train": 50})})
    asked = params.model_copy(update={"scenarios": {SCENARIO: more}})
    assert training_pairs(asked, SCENARIO, blank) == 50


def test_larger_clouds_cost_more(params: Params) -> None:
    made = params.scenarios[SCENARIO]
    large = made.model_copy(update={"num_points": 4096})
    step_seconds(params, CF, made)
    assert step_seconds(params, CF, large) > step_seconds(params, CF, made)


def test_data_that_is_not_there_is_one_sentence(params: Params, blank: Path) -> None:
    with pytest.raises((FileNotFoundError, ValueError), match="nowhere") as refused:
        training_pairs(params, SCENARIO, blank / "nowhere")
    assert "\n" not in str(refused.value)


def test_the_table_ends_with_the_total() -> None:
    lines = list(told([Estimate("a", "b", 2, 1800, 1.0), Estimate("c", "d", 1, 3600, 2.0)]))
    assert [line.split()[-1] for line in lines] == ["core-hours", "0.50", "2.00", "2.50"]
    assert len({len(line) for line in lines}) == 1
