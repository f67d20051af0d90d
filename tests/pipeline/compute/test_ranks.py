"""Several processes learn what one learns from the batch of all; one needs nobody."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from pcrdiff.training.budget import Epoch
from pcrdiff.training.ranks import ALONE
from pipeline.compute.ranks import check_agreement, join
from pipeline.tracking.run import is_running, process_identity
from tests.described import REPOSITORY
from tests.pipeline.compute.training_together import (
    EPOCHS,
    NAMES,
    RESUMED,
    Memory,
    Outcome,
    outcome,
)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Outcome]:
    """What each of two processes came to, by method and process."""
    folder = tmp_path_factory.mktemp("together")
    command = [sys.executable, "-m", "tests.pipeline.compute.training_together", str(folder)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    with torch.serialization.safe_globals([Epoch]):
        return {
            (name, rank): Outcome(**torch.load(folder / f"{name}-{rank}.pt", weights_only=True))
            for name in (*NAMES, RESUMED)
            for rank in range(2)
        }


def same(a: Outcome, b: Outcome) -> bool:
    """Whether two trainings agree to the last bit."""
    tensors = [
        {**each.best, **{f"last.{k}": v for k, v in each.weights.items()}} for each in (a, b)
    ]
    return (
        (a.curve, a.best_epoch) == (b.curve, b.best_epoch)
        and tensors[0].keys() == tensors[1].keys()
        and all(torch.equal(tensors[0][name], tensors[1][name]) for name in tensors[0])
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_two_processes_learn_what_one_learns_from_batches_twice_as_large(
    outcomes: dict[tuple[str, int], Outcome], name: str
) -> None:
    alone = outcome(name, ALONE, Memory(ALONE))
    together = outcomes[name, 0]
    assert len(together.curve) == EPOCHS
    for ours, theirs in zip(together.curve, alone.curve, strict=True):
        assert ours.losses == pytest.approx(theirs.losses, rel=1e-4)
        assert (ours.step, ours.learning_rate) == (theirs.step, theirs.learning_rate)
        assert (ours.val_error_r_deg is None) == (theirs.val_error_r_deg is None)
        if ours.val_error_r_deg is not None:
            assert ours.val_error_r_deg == pytest.approx(theirs.val_error_r_deg, rel=1e-3)
            assert ours.val_error_t == pytest.approx(theirs.val_error_t, rel=1e-3)
    assert together.best_epoch == alone.best_epoch
    for ours_, theirs_ in ((together.best, alone.best), (together.weights, alone.weights)):
        for key, value in theirs_.items():
            gap = (ours_[key] - value).square().mean().sqrt()
            assert gap < 1e-4, key  # a step of Adam is 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_both_processes_come_to_the_same(
    outcomes: dict[tuple[str, int], Outcome], name: str
) -> None:
    assert same(outcomes[name, 0], outcomes[name, 1])


@pytest.mark.slow
def test_both_processes_go_on_from_the_checkpoint_of_the_first(
    outcomes: dict[tuple[str, int], Outcome],
) -> None:
    assert same(outcomes[RESUMED, 0], outcomes[NAMES[0], 0])
    assert same(outcomes[RESUMED, 1], outcomes[NAMES[0], 0])


def test_one_process_needs_nobody() -> None:
    with join(1, 1) as processes:
        assert processes is ALONE
        check_agreement(processes, {}, [Path("not there, and not asked for")])
    code = "import sys, stages.train; sys.exit('lightning_fabric' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY).returncode == 0


def test_refuses_fewer_gpus_than_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    refused = pytest.raises(ValueError, match=r"train\.devices is 2, and this host has 1 GPUs")
    with refused, join(2, 1):
        pass


def test_refuses_to_train_along_with_other_params_or_pairs(tmp_path: Path) -> None:
    class Second:
        """The second process, to which the first says what it is told to say."""

        rank, count, device = 1, 2, torch.device("cpu")

        def __init__(self, said: object) -> None:
            self.said = said

        def of_first(self, value: object) -> object:
            return self.said or value

    pairs = tmp_path / "pairs.h5"
    pairs.write_bytes(b"pairs")
    check_agreement(Second(None), {"seed": 7}, [pairs])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="process 1 has other params, pairs or code than the"):
        check_agreement(Second("another"), {"seed": 7}, [pairs])  # type: ignore[arg-type]


WAIT = """\
import os, sys, time
from pathlib import Path
from pipeline.compute.ranks import join
with join(2, 1) as processes:
    starting = Path(sys.argv[1], f"starting-{processes.rank}")
    starting.write_text(str(os.getpid()))
    starting.rename(Path(sys.argv[1], f"rank-{processes.rank}"))
    time.sleep(120)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes by /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_the_other_processes_end_with_the_first(tmp_path: Path, number: int) -> None:
    script, other = tmp_path / "wait.py", tmp_path / "rank-1"
    script.write_text(WAIT)
    told = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(REPOSITORY)}
    first = subprocess.Popen([sys.executable, str(script), str(tmp_path)], env=told)
    until = time.monotonic() + 120
    while not other.exists():
        assert first.poll() is None
        assert time.monotonic() < until
        time.sleep(0.1)
    started = process_identity(int(other.read_text()))
    assert is_running(started)
    first.send_signal(number)
    first.wait(30)
    until = time.monotonic() + 10
    while is_running(started) and time.monotonic() < until:
        time.sleep(0.1)
    assert not is_running(started)
