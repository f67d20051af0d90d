"""The train stage, end to end: the same weights whatever happens on the way."""

import csv
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import pytest

from pipeline.compute import checkpoints
from pipeline.formats.weights import read_weights
from stages import train as training
from tests.described import REPOSITORY
from tests.tiny import (
    CB,
    CF,
    SCENARIO,
    files_below,
    instance,
    run_instance,
    tiny_params,
    weights,
    write_params,
)

CHECKPOINTS = Path(".pcrdiff") / "checkpoints"


def folder(method: str) -> Path:
    """Where a training writes."""
    return weights(method).parent


def outputs(method: str) -> dict[str, bytes]:
    """The bytes of all that a training writes."""
    return {path.name: path.read_bytes() for path in sorted(folder(method).glob("*"))}


def forget(method: str) -> None:
    for path in folder(method).glob("*"):
        path.unlink()


def run_train(method: str) -> None:
    run_instance(instance(f"train@{SCENARIO}-{method}"))


class Killed(BaseException):
    """Stands for a kill."""


def killed_after(epochs: int) -> type:
    """A progress bar under which a training dies before it begins one more epoch."""

    class Bar:
        def __init__(self, items: Sequence[int], description: str) -> None:
            del description
            self.items = items

        def __iter__(self) -> Iterator[int]:
            for done, item in enumerate(self.items):
                if done == epochs:
                    raise Killed
                yield item

    return Bar


def counted_in(seen: list[int]) -> Callable[[Sequence[int], str], Iterable[int]]:
    """A progress bar that notes the epochs that are run."""

    def bar(items: Sequence[int], description: str) -> Iterable[int]:
        del description
        for item in items:
            seen.append(item)
            yield item

    return bar


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", [CF, CB])
def test_the_same_params_write_the_same_bytes(method: str) -> None:
    before = outputs(method)
    assert sorted(before) == ["curve.csv", "facts.json", "weights.safetensors"]
    forget(method)
    run_train(method)
    assert outputs(method) == before


@pytest.mark.parametrize("epochs", [0, 1, 2])
@pytest.mark.parametrize("method", [CF, CB])
def test_a_killed_training_goes_on_and_ends_with_the_same_bytes(
    project: Path, monkeypatch: pytest.MonkeyPatch, method: str, epochs: int
) -> None:
    before = outputs(method)
    forget(method)
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(training, "bar", killed_after(epochs))
        with pytest.raises(Killed):
            run_train(method)
    assert outputs(method) == {}
    assert len(list(CHECKPOINTS.glob("*/latest.safetensors"))) == (epochs > 0)
    seen: list[int] = []
    monkeypatch.setattr(training, "bar", counted_in(seen))
    run_train(method)
    assert seen == list(range(epochs, 3))
    assert outputs(method) == before
    assert files_below(project / CHECKPOINTS) == []


@pytest.mark.parametrize("method", ["pcrnet", "rpmnet"])
def test_a_baseline_writes_the_same_bytes_for_each_scenario_again(
    project: Path, method: str
) -> None:
    before = outputs(method)
    assert sorted(before) == ["curve.csv", "facts.json", "weights.safetensors"]
    assert read_weights(project / weights(method), method)
    forget(method)
    run_instance(instance(f"train_baselines@{method}"))
    assert outputs(method) == before


def test_of_several_trainings_in_a_stage_those_that_were_done_go_on_from_their_end(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = sorted((project / "models" / "ablations" / "diffusion" / "without").rglob("*.*"))
    before = {path: path.read_bytes() for path in files}
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN", 0.0)
    seen: list[int] = []

    def bar(items: Sequence[int], description: str) -> Iterable[int]:
        for item in counted_in(seen)(items, description):
            if len(seen) == 4:  # the second epoch of the second of two trainings
                raise Killed
            yield item

    with monkeypatch.context() as patch:
        patch.setattr(training, "bar", bar)
        with pytest.raises(Killed):
            run_instance(instance("train_diffusion@without"))
    assert len(list(CHECKPOINTS.glob("*/latest.safetensors"))) == 2
    again: list[int] = []
    monkeypatch.setattr(training, "bar", counted_in(again))
    run_instance(instance("train_diffusion@without"))
    assert again == [1]
    assert {path: path.read_bytes() for path in files} == before
    assert files_below(project / CHECKPOINTS) == []


def test_nothing_is_left_of_the_checkpoint_after_success(project: Path) -> None:
    assert (project / weights(CF)).is_file()
    assert list((project / CHECKPOINTS).iterdir()) == []


def test_other_data_does_not_go_on_from_the_checkpoint_of_these(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoints, "SECONDS_BETWEEN", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(training, "bar", killed_after(2))
        with pytest.raises(Killed):
            run_train(CF)
    pairs = project / "data" / "pairs" / f"{SCENARIO}.h5"
    boxes = project / "boxes" / "bed" / "train" / "bed_0001.off"
    boxes.write_text(boxes.read_text().replace(" 0.0\n", " 0.1\n"))
    old = pairs.read_bytes()
    for name in ("acquire@modelnet40", f"preprocess@{SCENARIO}"):
        run_instance(instance(name))
    assert pairs.read_bytes() != old
    seen: list[int] = []
    monkeypatch.setattr(training, "bar", counted_in(seen))
    run_train(CF)
    assert seen == [0, 1, 2]


def test_the_weights_are_those_of_the_method_and_the_facts_and_curve_agree(project: Path) -> None:
    facts = json.loads((project / folder(CF) / "facts.json").read_text())
    curve = list(csv.DictReader((project / folder(CF) / "curve.csv").read_text().splitlines()))
    assert len(read_weights(weights(CF), CF)) > 0
    assert [row["epoch"] for row in curve] == ["0", "1", "2"]
    best = curve[facts["best_epoch"]]
    assert float(best["val_error_r_deg"]) == facts["val_error_r_deg"]
    assert {"epoch", "loss"} <= curve[0].keys()  # what dvc.yaml plots


# Two processes.


def run_two(module: str, *how: str) -> subprocess.CompletedProcess[str]:
    """Train CF in two processes, from a command line as DVC has it."""
    params = tiny_params()
    params["train"] |= {"devices": 2}
    params["train"][CF] |= {"batch_size": 2}
    write_params(params)
    command = [sys.executable, "-m", module, *how, *instance(f"train@{SCENARIO}-{CF}").argv]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)


def curve_of(method: str) -> list[dict[str, float]]:
    rows = csv.DictReader((folder(method) / "curve.csv").read_text().splitlines())
    return [{name: float(value) for name, value in row.items()} for row in rows]


def processes_of(project: Path) -> list[Path]:
    """The processes that work in a folder."""
    return [p for p in Path("/proc").glob("[0-9]*/cwd") if p.exists() and p.samefile(project)]


@pytest.mark.slow
def test_two_processes_train_as_one_does_and_go_on_when_killed_with_the_same_bytes(
    project: Path,
) -> None:
    alone = curve_of(CF)
    done = run_two("stages", "train")
    assert done.returncode == 0, done.stderr
    whole = outputs(CF)
    for ours, theirs in zip(curve_of(CF), alone, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-3)
    assert json.loads(whole["facts.json"])["devices"] == 2

    forget(CF)
    killed = run_two("tests.stages.train_broken", "killed", "0")
    assert killed.returncode == -signal.SIGKILL
    assert outputs(CF) == {}
    assert len(list(CHECKPOINTS.glob("*/latest.safetensors"))) == 1
    resumed = run_two("stages", "train")
    assert resumed.returncode == 0, resumed.stderr
    assert " 2/2 " in resumed.stderr  # of the bar: the first of three epochs is done
    assert outputs(CF) == whole
    assert files_below(project / CHECKPOINTS) == []


@pytest.mark.slow
@pytest.mark.parametrize("how", ["raises", "killed"])
def test_a_process_that_dies_takes_the_other_with_it(project: Path, how: str) -> None:
    forget(CF)
    done = run_two("tests.stages.train_broken", how, "1")
    assert done.returncode != 0
    said = [line for line in done.stderr.splitlines() if line.startswith("train: ")]
    lost = "train: process 0 of 2 ends because it has lost another; "
    noticed = [True]
    if done.returncode == -signal.SIGKILL:  # Fabric looks every five seconds, and was first
        noticed = []
        assert "Forcefully terminating all other processes" in done.stderr
    assert [line.startswith(lost) for line in said] == (
        [False, *noticed] if how == "raises" else noticed
    )
    assert ("train: a deliberate mistake" in said) == (how == "raises")
    assert "Traceback" not in done.stderr
    assert outputs(CF) == {}
    assert processes_of(project) == [Path(f"/proc/{os.getpid()}/cwd")]


def test_refuses_an_ablation_without_the_value_to_train(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pairs = ["--pairs", str(project / "pairs.h5"), "--models", str(project / "models")]
    with pytest.raises(SystemExit) as ended:
        training.main(["--ablation", "fusion", *pairs])
    assert ended.value.code == 2
    assert "--ablation needs --value" in capsys.readouterr().err
