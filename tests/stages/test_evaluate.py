"""The evaluate stage, end to end."""

import csv
import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import torch

from pcrdiff.methods.icp import ICP
from pcrdiff.registration import EVIDENCE
from pipeline.formats.answers import ANSWER, CHAMFER, JUDGED
from pipeline.formats.pairs import read_pairs
from pipeline.formats.verdicts import read_verdicts
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
    weights,
    write_params,
)

MULTISTART = "gicp_multistart"
CLASSICAL = ("identity", "constant", "icp_centroid", "icp", "fgr")
PAIRS_OF_TEST = 3


def written(method: str) -> Path:
    """Where a method's answers lie."""
    return Path("results", method, f"{SCENARIO}.csv")


def run_evaluate(method: str) -> None:
    group = "evaluate" if method in (CF, CB) else "evaluate_baselines"
    classical = method in (*CLASSICAL, MULTISTART)
    run_instance(instance(f"{'evaluate_classical' if classical else group}@{method}"))


def rows(method: str) -> list[dict[str, str]]:
    return list(csv.DictReader(written(method).read_text().splitlines()))


def metrics() -> dict[str, float]:
    """What the newest journal has of them."""
    newest = max(
        Path(".pcrdiff/journal").glob("*/journal.jsonl"), key=lambda p: p.stat().st_mtime_ns
    )
    events = map(json.loads, newest.read_text().splitlines())
    return {k: v for e in events if e["event"] == "metrics" for k, v in e["values"].items()}


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", [*CLASSICAL, "pcrnet", "rpmnet", CF, CB])
def test_there_is_a_row_a_pair_and_setting(method: str) -> None:
    section = tiny_params()["methods"][method]
    settings = list(section if method in CLASSICAL else section["settings"])
    assert Counter(row["setting"] for row in rows(method)) == dict.fromkeys(settings, 3)
    assert list(rows(method)[0]) == [*ANSWER, CHAMFER, *JUDGED]
    assert {row[name] for row in rows(method) for name in (CHAMFER, *JUDGED)} == {""}
    test = read_pairs(PAIRS, "test")
    for row in rows(method):
        assert int(row["item"]) == int(test.item[int(row["pair"])])
        assert row["group"] == test.group[int(row["pair"])]


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", ["icp", "rpmnet", CF])
def test_the_metrics_are_those_of_the_rows(method: str) -> None:
    run_evaluate(method)
    chosen = [row for row in rows(method) if row["setting"] == "paper"]
    angles = torch.tensor([float(row["error_r_deg"]) for row in chosen], dtype=torch.float64)
    name = "cf.unseen_objects" if method == CF else method
    assert metrics()[name] == pytest.approx(angles.mean().item())


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", ["constant", "icp", MULTISTART, "pcrnet", CF, CB])
def test_writes_the_same_bytes_twice(method: str) -> None:
    before = written(method).read_bytes()
    run_evaluate(method)
    assert written(method).read_bytes() == before


@pytest.mark.usefixtures("project")
def test_a_method_that_verifies_says_what_speaks_for_its_answers_and_how_probable_they_are() -> (
    None
):
    folder, answers = written(MULTISTART).parent, rows(MULTISTART)
    (verdict,) = read_verdicts(folder / "verdicts" / f"{SCENARIO}.json").values()
    assert verdict.pairs == len(read_pairs(PAIRS, "val"))
    evidence = np.array([[float(row[name]) for name in EVIDENCE] for row in answers])
    assert ((evidence[:, 1:3] >= 0) & (evidence[:, 1:3] <= 1)).all()
    told = [float(row["probability"]) for row in answers]
    assert told == pytest.approx(verdict.probability(evidence).tolist())
    judging = {Path(path).parts[0] for path in files_below(Path("results")) if "verdicts" in path}
    assert judging == {MULTISTART, "sc2_pcr"}


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


def test_the_steps_change_the_answers_of_what_samples(project: Path) -> None:
    before = (project / written(CF)).read_bytes()
    params = tiny_params()
    params["diffusion"]["steps"] = 3
    write_params(params)
    run_evaluate(CF)
    assert (project / written(CF)).read_bytes() != before


def test_a_learned_method_without_weights_is_refused_and_old_results_stay(project: Path) -> None:
    (project / weights(CF)).unlink()
    before = files_below(project / "results")
    said = refusal("evaluate", instance(f"evaluate@{CF}").argv)
    assert f"{weights(CF)}, there are none: run train" in said
    assert files_below(project / "results") == before
