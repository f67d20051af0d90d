"""One thread for everybody, set before anything that would start more is loaded."""

import os
import sys

import pytest

from benchmarks import threads
from benchmarks.threads import ALL, VARIABLES, every_processor, hold_to_one


class Replaced(Exception):
    """Instead of another program."""


def test_the_command_starts_anew_under_the_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []

    def execve(path: str, command: list[str], environment: dict[str, str]) -> None:
        told.extend([path, command, {name: environment[name] for name in VARIABLES}])
        raise Replaced

    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    monkeypatch.setattr(os, "execve", execve)
    with pytest.raises(Replaced):
        hold_to_one(["--dry"])
    command = [sys.executable, "-m", "benchmarks", "--dry"]
    assert told == [sys.executable, command, dict.fromkeys(VARIABLES, "1")]


def test_under_the_variables_it_goes_on_with_one_processor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in VARIABLES:
        monkeypatch.setenv(name, "1")
    try:
        hold_to_one([])
        assert len(os.sched_getaffinity(0)) == 1
        with every_processor():
            assert os.sched_getaffinity(0) == ALL
        assert len(os.sched_getaffinity(0)) == 1
    finally:
        threads.hold_to_processors(ALL)
