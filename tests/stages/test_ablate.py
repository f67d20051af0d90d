"""The ablate stage, end to end."""

import csv
from collections import Counter
from pathlib import Path

import pytest

from tests.tiny import CB, CF, SCENARIO, files_below, instance, refusal, run_instance, weights

ANSWERS = Path("results/ablations/steps.csv")


def read_rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture(autouse=True)
def ablated(project: Path) -> Path:
    run_instance(instance("ablate_steps"))
    return project


def test_there_is_a_row_a_pair_method_and_value() -> None:
    counts = Counter((row["method"], row["setting"]) for row in read_rows(ANSWERS))
    walks = [f"steps={n},sampler={sampler}" for n in (1, 2) for sampler in ("ddpm", "ddim")]
    again = [f"{walk},draw=1" for walk in walks]  # CF's walks are drawn twice
    assert counts == dict.fromkeys([(CB, w) for w in walks] + [(CF, w) for w in walks + again], 3)


def test_writes_the_same_bytes_twice(ablated: Path) -> None:
    before = (ablated / ANSWERS).read_bytes()
    run_instance(instance("ablate_steps"))
    assert (ablated / ANSWERS).read_bytes() == before


def test_the_unvaried_value_gives_the_rows_of_the_evaluation() -> None:
    evaluated = read_rows(Path(f"results/{CF}/{SCENARIO}.csv"))
    walk = (CF, "steps=1,sampler=ddpm")
    ablation = [r for r in read_rows(ANSWERS) if (r["method"], r["setting"]) == walk]
    for ours, theirs in zip(ablation, evaluated, strict=True):
        del ours["method"]
        assert ours | {"setting": "paper"} == theirs


def test_weights_that_were_cut_are_refused_and_named(ablated: Path) -> None:
    path = ablated / weights(CB)
    path.write_bytes(path.read_bytes()[:-8])
    (ablated / ANSWERS).unlink()
    said = refusal("ablate", instance("ablate_steps").argv)
    assert f"{weights(CB)} is not a safetensors file" in said
    assert "ablations/steps.csv" not in files_below(ablated / "results")


def test_a_name_that_no_ablation_has_is_refused() -> None:
    argv = ["--pairs", "a", "--models", "b", "--answers", "c/steps.csv", "c/luck.csv"]
    assert "luck" in refusal("ablate", argv)


def test_every_ablation_of_a_stage_has_its_file(ablated: Path) -> None:
    outs = [path for name in ("ablate", "ablate_steps") for path in instance(name).outs]
    files = [ablated / path for path in outs if path.endswith(".csv")]
    before = {path: path.read_bytes() for path in files}
    assert len(before) == 5
    run_instance(instance("ablate"))
    assert {path: path.read_bytes() for path in files} == before
