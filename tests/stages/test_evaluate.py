"""The evaluate stage, end to end."""

import csv
import json
from collections import Counter
from pathlib import Path

import pytest
import torch

from pcrdiff.methods.icp import ICP
from pipeline.artifacts import ANSWER, read_pairs
from tests.tiny import (
    CB,
    CF,
    PAIRS,
    SCENARIO,
    files_below,
    instance,
    refusal,
    run_instance,
    tiny_params,
    write_params,
)

FOLDER = Path("results") / SCENARIO
CLASSICAL = ("identity", "constant", "icp_centroid", "icp", "fgr")
PAIRS_OF_TEST = 3


def run_evaluate(method: str) -> None:
    template = "evaluate_classical" if method in CLASSICAL else "evaluate"
    run_instance(instance(f"{template}@{SCENARIO}-{method}"))


def rows(method: str) -> list[dict[str, str]]:
    return list(csv.DictReader((FOLDER / f"{method}.csv").read_text().splitlines()))


def metrics(method: str) -> dict[str, float]:
    read: dict[str, float] = json.loads((FOLDER / f"{method}.json").read_text())
    return read


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", [*CLASSICAL, CF, CB])
def test_there_is_a_row_a_pair_and_setting(method: str) -> None:
    settings = ["paper"]
    if method in CLASSICAL:
        settings = list(tiny_params()["methods"][method])
    assert Counter(row["setting"] for row in rows(method)) == dict.fromkeys(settings, 3)
    assert list(rows(method)[0]) == ANSWER
    test = read_pairs(PAIRS, "test")
    for row in rows(method):
        assert int(row["item"]) == int(test.item[int(row["pair"])])
        assert row["group"] == test.group[int(row["pair"])]


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", [*CLASSICAL, CF, CB])
def test_the_metrics_are_those_of_the_rows(method: str) -> None:
    for setting in {row["setting"] for row in rows(method)}:
        chosen = [row for row in rows(method) if row["setting"] == setting]
        angles = torch.tensor([float(row["error_r_deg"]) for row in chosen], dtype=torch.float64)
        failed = sum(row["failure"] != "" for row in chosen)
        told = metrics(method)
        assert told[f"{setting}.error_r_deg"] == pytest.approx(angles.mean().item())
        assert told[f"{setting}.median_error_r_deg"] == pytest.approx(angles.median().item())
        assert told[f"{setting}.failures"] == failed == 0


@pytest.mark.parametrize("method", ["constant", "icp", CF, CB])
def test_writes_the_same_bytes_twice(project: Path, method: str) -> None:
    before = [(project / FOLDER / f"{method}.{kind}").read_bytes() for kind in ("csv", "json")]
    run_evaluate(method)
    after = [(project / FOLDER / f"{method}.{kind}").read_bytes() for kind in ("csv", "json")]
    assert after == before


@pytest.mark.usefixtures("project")
def test_the_identity_is_off_by_the_pose_itself() -> None:
    for row, pose in zip(rows("identity"), read_pairs(PAIRS, "test").T_target_source, strict=True):
        assert float(row["error_t"]) == pytest.approx(pose[:3, 3].norm().item())


@pytest.mark.usefixtures("project")
def test_a_method_that_fails_on_a_pair_is_counted_and_its_row_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    register = ICP.register
    calls: list[int] = []

    def sometimes(
        self: ICP, source: torch.Tensor, target: torch.Tensor, *, generator: torch.Generator
    ) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 3:  # a pair is shown to both settings before the next
            raise RuntimeError("Open3D gave up\nat line 7")
        pose: torch.Tensor = register(self, source, target, generator=generator)
        return pose

    monkeypatch.setattr(ICP, "register", sometimes)
    run_evaluate("icp")
    assert len(rows("icp")) == 2 * PAIRS_OF_TEST
    failures = [(row["setting"], row["pair"], row["failure"]) for row in rows("icp")]
    assert failures[:3] == [
        ("paper", "0", ""),
        ("paper", "1", "Open3D gave up"),
        ("paper", "2", ""),
    ]
    failed = rows("icp")[1]
    assert [float(failed[f"T{k}{k}"]) for k in range(3)] == [1.0, 1.0, 1.0]
    assert failed["error_r_deg"] == rows("identity")[1]["error_r_deg"]
    assert (metrics("icp")["paper.failures"], metrics("icp")["official.failures"]) == (1.0, 0.0)


def test_the_steps_change_the_answers_of_what_samples(project: Path) -> None:
    before = (project / FOLDER / f"{CF}.csv").read_bytes()
    params = tiny_params()
    params["diffusion"]["steps"] = 3
    write_params(params)
    run_evaluate(CF)
    assert (project / FOLDER / f"{CF}.csv").read_bytes() != before


def test_a_learned_method_without_weights_is_refused_and_old_results_stay(project: Path) -> None:
    (project / "models" / SCENARIO / f"{CF}.safetensors").unlink()
    before = files_below(project / "results")
    said = refusal("evaluate", instance(f"evaluate@{SCENARIO}-{CF}").argv)
    assert f"{CF}.safetensors, there are none: run train" in said
    assert files_below(project / "results") == before
