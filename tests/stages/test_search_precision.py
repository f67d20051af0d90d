"""What params say of the search is what a stage does, and its journal says what that came to."""

import json
from pathlib import Path

import pytest

from pcrdiff.geometry.precision import search_precision
from tests.tiny import CF, SCENARIO, instance, run_instance, tiny_params, write_params

LEARNED = [f"train@{SCENARIO}-{CF}", f"evaluate@{CF}", "ablate", "ablate_steps"]


def journals() -> set[Path]:
    return {*Path(".pcrdiff/journal").glob("*/journal.jsonl")}


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize(
    "stage", [*LEARNED, "train_baselines@rpmnet", "evaluate_baselines@rpmnet", "time"]
)
def test_a_stage_searches_as_told_and_notes_it(stage: str, processor: str) -> None:
    write_params(tiny_params() | {"search_precision": "auto"})
    before = journals()
    run_instance(instance(stage))
    wanted = "bfloat16" if processor == "with bfloat16" else "float32"
    assert search_precision() == wanted
    (made,) = journals() - before
    start = json.loads(made.read_text(encoding="utf-8").splitlines()[0])
    assert start["params"]["search_precision"] == wanted
