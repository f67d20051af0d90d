"""One thread for everybody: ours, torch's, OpenMP's and TBB's. Loads nothing that starts threads."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS")
ALL = frozenset(os.sched_getaffinity(0)) if sys.platform == "linux" else frozenset[int]()
"""The processors that this process was given."""


def hold_to_one(argv: Sequence[str]) -> None:
    """Restart `python -m benchmarks` under the variables, or continue where they are set.

    Libraries read them when they are loaded. Those that count the processors instead (TBB, in
    Open3D and KISS-Matcher) are shown one.
    """
    wanted = dict.fromkeys(VARIABLES, "1")
    if wanted.items() <= os.environ.items():
        hold_to_processors(frozenset(sorted(ALL)[-1:]))
        return
    command = [sys.executable, "-m", "benchmarks", *argv]
    os.execve(sys.executable, command, {**os.environ, **wanted})


def hold_to_processors(processors: frozenset[int]) -> None:
    """Let this process, and those it starts, run on these processors alone; on Linux."""
    if sys.platform == "linux":
        os.sched_setaffinity(0, processors)


@contextmanager
def every_processor() -> Iterator[None]:
    """Let what is measured here start processes on all processors."""
    before = frozenset(os.sched_getaffinity(0)) if sys.platform == "linux" else ALL
    hold_to_processors(ALL)
    try:
        yield
    finally:
        hold_to_processors(before)
