"""Several processes learn what one learns from the batch of all; one needs nobody."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from pcrdiff.processes import ALONE
from pipeline.processes import check_agreement, join
from tests.described import REPOSITORY
from tests.pipeline.training_together import EPOCHS, NAMES, Memory, outcome

Outcome = dict[str, Any]


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Outcome]:
    """What each of two processes came to, by method and process."""
    folder = tmp_path_factory.mktemp("together")
    command = [sys.executable, "-m", "tests.pipeline.training_together", str(folder)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return {
        (name, rank): json.loads((folder / f"{name}-{rank}.json").read_text())
        for name in NAMES
        for rank in range(2)
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_two_processes_learn_what_one_learns_from_batches_twice_as_large(
    outcomes: dict[tuple[str, int], Outcome], name: str
) -> None:
    alone = outcome(name, ALONE, Memory(ALONE))
    together = outcomes[name, 0]["whole"]
    assert len(together["curve"]) == EPOCHS
    for ours, theirs in zip(together["curve"], alone["curve"], strict=True):  # type: ignore[call-overload]
        assert ours.pop("losses") == pytest.approx(theirs.pop("losses"), rel=2e-4)
        assert ours == pytest.approx(theirs, rel=2e-3)
    assert together["best_epoch"] == alone["best_epoch"]
    for part in ("best", "weights"):
        for key, value in alone[part].items():  # type: ignore[attr-defined]
            torch.testing.assert_close(
                torch.tensor(together[part][key]), torch.tensor(value), rtol=1e-3, atol=2e-4
            )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_both_processes_come_to_the_same_and_so_they_do_after_a_break(
    outcomes: dict[tuple[str, int], Outcome], name: str
) -> None:
    first, second = outcomes[name, 0], outcomes[name, 1]
    assert first == second
    assert first["resumed"] == first["whole"]


def test_one_process_needs_nobody() -> None:
    with join(1, 1) as processes:
        assert processes is ALONE
        check_agreement(processes, {}, [Path("not there, and not asked for")])
    code = "import sys, stages.train; sys.exit('lightning_fabric' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY).returncode == 0


def test_refuses_fewer_gpus_than_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    with pytest.raises(ValueError, match=r"train\.devices is 2, and this host has 1 GPUs"):
        with join(2, 1):
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
