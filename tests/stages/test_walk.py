"""The walk stage, end to end."""

from pathlib import Path

import pytest

from pipeline.formats.walks import read_walks
from tests.tiny import CB, CF, SCENARIO, instance, refusal, run_instance, weights


def written(method: str) -> Path:
    return Path(f"results/walks/{SCENARIO}/{method}.csv")


@pytest.mark.parametrize("method", [CF, CB])
def test_writes_every_step_of_a_few_pairs_the_same_bytes_twice(project: Path, method: str) -> None:
    before = (project / written(method)).read_bytes()
    walks = read_walks(written(method))
    assert [(walk.pair, len(walk.times)) for walk in walks] == [(0, 3), (2, 3)]
    written(method).unlink()
    run_instance(instance("walk"))
    assert (project / written(method)).read_bytes() == before


def test_weights_that_are_not_there_are_named_and_nothing_is_written(project: Path) -> None:
    (project / weights(CF)).unlink()
    written(CF).unlink()
    said = refusal("walk", instance("walk").argv)
    assert f"weights are needed at {weights(CF)}" in said
    assert not written(CF).exists()
