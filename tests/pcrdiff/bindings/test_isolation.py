"""Calls in a child process."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pcrdiff.bindings.isolation import Isolated


def double(values: np.ndarray) -> np.ndarray:
    return 2 * values


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def leave() -> None:
    os._exit(3)


def refuse(reason: str) -> None:
    raise ValueError(reason)


def chatter() -> str:
    print("noise")  # noqa: T201
    return "answer"


def processors() -> int:
    return len(os.sched_getaffinity(0))


def has_torch() -> bool:
    return "torch" in sys.modules


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def ends_soon(pid: int) -> bool:
    deadline = time.monotonic() + 10
    while is_alive(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not is_alive(pid)


def test_answers_as_a_direct_call_would_from_one_child_that_is_not_this_process() -> None:
    isolated, values = Isolated("it", 30.0), np.arange(5.0)
    assert np.array_equal(isolated.call(double, values), double(values))
    assert np.array_equal(isolated.call(double, -values), double(-values))
    pid = isolated.call(os.getpid)
    assert pid == isolated.call(os.getpid) != os.getpid()


def test_a_crash_is_told_with_its_signal_and_the_next_call_works() -> None:
    isolated = Isolated("kiss_matcher", 30.0)
    said = r"^kiss_matcher's native code ended its process \(signal 11\)$"
    for _ in range(2):
        with pytest.raises(RuntimeError, match=said):
            isolated.call(crash)
        assert isolated.call(abs, -3) == 3


def test_a_child_that_leaves_is_told_with_its_status() -> None:
    with pytest.raises(RuntimeError, match=r"\(exit status 3\)$"):
        Isolated("it", 30.0).call(leave)


def test_a_call_that_takes_too_long_is_ended_and_its_answer_is_not_the_next_ones() -> None:
    isolated = Isolated("it", 30.0)
    pid = isolated.call(os.getpid)
    isolated.seconds = 0.2
    with pytest.raises(RuntimeError, match=r"^it needs an answer in 0\.2 s, got none$"):
        isolated.call(time.sleep, 30)
    assert ends_soon(pid)
    isolated.seconds = 30.0
    assert isolated.call(abs, -3) == 3


def test_what_the_function_raises_is_raised_here_and_the_child_is_kept() -> None:
    isolated = Isolated("it", 30.0)
    pid = isolated.call(os.getpid)
    with pytest.raises(ValueError, match=r"^it needs more$"):
        isolated.call(refuse, "it needs more")
    assert isolated.call(os.getpid) == pid


def test_what_native_code_prints_does_not_disturb(capfd: pytest.CaptureFixture[str]) -> None:
    assert Isolated("it", 30.0).call(chatter) == "answer"
    assert capfd.readouterr().out == ""


def test_the_child_has_one_processor_and_no_torch() -> None:
    isolated = Isolated("it", 30.0)
    assert isolated.call(os.getenv, "OMP_NUM_THREADS") == "1"
    assert isolated.call(processors) == 1
    assert not isolated.call(has_torch)


def test_the_child_ends_when_nobody_can_call_it_any_more() -> None:
    isolated = Isolated("it", 30.0)
    pid = isolated.call(os.getpid)
    assert is_alive(pid)
    del isolated
    assert ends_soon(pid)


@pytest.mark.parametrize("end", ["pass", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_no_child_survives_its_parent(end: str) -> None:
    script = (
        "import os, signal\n"
        "from pcrdiff.bindings.isolation import Isolated\n"
        "isolated = Isolated('it', 30.0)\n"
        "print(isolated.call(os.getpid), flush=True)\n"
        f"{end}\n"  # no main guard: the child does not import its parent's main module
    )
    parent = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, check=False)
    assert ends_soon(int(parent.stdout))
