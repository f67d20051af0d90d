"""`dvc repro` with several stages at once. DVC itself runs one after the other.

Each stage is a `dvc repro --single-item`, so that skipping, the run cache and dvc.lock are DVC's.
It runs in a fork of this process, which has imported DVC: that costs 0.3 s, a new process 0.8.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, TextIO

from pipeline.command.graph import Needs, group_of, stage_needs, wanted
from pipeline.command.locks import check_locks, only_repro
from pipeline.command.plan import alone_groups, outdated, stale_manifests
from pipeline.tracking.run import SHELL, VARIABLE, descendants, process_identity

LAST_LINES = 15  # of a failed stage's output that are shown
UNCHANGED = "Data and pipelines are up to date.\n"
"""DVC's last words on a stage that need not run: what it reads was written again, and is equal."""


@dataclass(frozen=True)
class Finished:
    """One stage that was run or taken from DVC's cache."""

    stage: str
    seconds: float
    """On the wall."""
    cpu_seconds: float
    """Processor time of all its processes, DVC's part of the work included."""


@dataclass(frozen=True)
class Running:
    """A stage on its way."""

    stage: str
    log: Path
    start: float = field(default_factory=time.monotonic)


def repro(
    root: Path, targets: Sequence[str], *, jobs: int, tell: Callable[[Finished], None]
) -> list[Finished]:
    """Bring the pipeline up to date, up to ``jobs`` independent stages at the same time.

    Args:
        root: The project.
        targets: Stages, or groups such as ``train``, with all they need; none means all.
        jobs: How many stages may run at once.
        tell: Called as each stage that was not up to date ends.

    Returns:
        What was run, in the order in which it ended.

    Raises:
        ValueError: A stage failed (those beside it were let finish), no such stage, no project, or
            somebody else works in it.
    """
    with only_repro(root):
        check_locks(root)
        needs = wanted(stage_needs(root), targets)
        for name, manifest in stale_manifests(root).items():
            if name in needs:
                manifest.unlink()  # DVC sees that, and has the data set acquired again
        launcher = Launcher(root, needs)
        finished: list[Finished] = []
        try:
            for ended in launcher.run(jobs):
                tell(ended)
                finished.append(ended)
        finally:
            launcher.end()
        return finished


def timings(finished: Iterable[Finished]) -> list[str]:
    """What the stages took, as a table: a line for each group of dvc.yaml, and its longest."""
    groups: dict[str, list[Finished]] = {}
    for one in finished:
        groups.setdefault(group_of(one.stage), []).append(one)
    lines = [f"{'':20} {'count':>5} {'total s':>8} {'CPU s':>8} {'longest s':>9}"] if groups else []
    for name, members in groups.items():
        longest = max(members, key=lambda one: one.seconds)
        total, cpu = (sum(getattr(m, kind) for m in members) for kind in ("seconds", "cpu_seconds"))
        which = longest.stage.partition("@")[2]
        numbers = f"{len(members):5} {total:8.1f} {cpu:8.1f} {longest.seconds:9.1f}"
        lines.append(f"{name:20} {numbers}  {which}")
    return lines


class Launcher:
    """Starts stages as those they need have ended."""

    def __init__(self, root: Path, needs: Needs) -> None:
        """Look up which stages of this graph have to run."""
        self.root, self.needs = root, needs
        self.pending = [stage for stage, _ in outdated(root, needs)]  # the most urgent first
        self.alone = alone_groups(root)
        self.running: dict[int, Running] = {}
        self.failure = ""

    def run(self, jobs: int) -> Iterator[Finished]:
        """Run everything; yields each stage that was not up to date as it ends."""
        while self.running or (self.pending and not self.failure):
            while not self.failure and len(self.running) < jobs and (stage := self._next()):
                self._start(stage)
            yield from self._reap()
        if self.failure:
            raise ValueError(self.failure)

    def end(self) -> None:
        """End what still runs, with all that it has started."""
        for pid in self.running:
            os.kill(pid, signal.SIGTERM)
        for pid in self.running:
            os.waitpid(pid, 0)

    def _next(self) -> str | None:
        """Choose a stage that waits for none, and runs beside none where it is to be alone."""
        beside = {one.stage for one in self.running.values()}
        waiting = beside.union(self.pending)
        ready = (stage for stage in self.pending if self.needs[stage].isdisjoint(waiting))
        alone = (stage for stage in ready if not self.alone & {*map(group_of, [stage, *beside])})
        return next(alone if beside else ready, None)

    def _start(self, stage: str) -> None:
        import dvc.api
        import dvc.cli  # noqa: F401  both for the forks

        self.pending.remove(stage)
        log = self.root / ".pcrdiff" / "logs" / f"{stage}.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("w", buffering=1, encoding="utf-8", errors="surrogateescape") as file:
            pid = os.fork()
            if pid == 0:
                be_dvc(self.root, stage, file)
        self.running[pid] = Running(stage, log)

    def _reap(self) -> Iterator[Finished]:
        pid, status, used = os.wait4(-1, 0)
        one = self.running.pop(pid, None)
        if one is None:
            return  # a child of our caller's
        said = one.log.read_text(encoding="utf-8", errors="replace")
        if status:
            last = said.splitlines()[-LAST_LINES:]
            self.failure = "\n".join([f"stage {one.stage} failed; the end of {one.log}:", *last])
        elif not said.endswith(UNCHANGED):
            seconds = time.monotonic() - one.start
            yield Finished(one.stage, seconds, used.ru_utime + used.ru_stime)


def be_dvc(root: Path, stage: str, log: TextIO) -> NoReturn:
    """Be the `dvc` that runs this stage or restores it, for the rest of this process."""
    code = 1
    try:
        from dvc.cli import main

        from pipeline.compute.machine import end_with_parent

        signal.signal(signal.SIGTERM, _end)
        end_with_parent(signal.SIGTERM)
        os.chdir(root)
        os.environ.update({VARIABLE: process_identity(os.getppid()), "SHELL": SHELL})
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        sys.argv = ["dvc", "--wait-for-lock", "repro", "--single-item", stage]
        with redirect_stdout(log), redirect_stderr(log):
            code = main(sys.argv[1:])
        log.flush()
    finally:
        os._exit(code)


def _end(number: int, _frame: object) -> NoReturn:
    """End what DVC has started as well, which would keep running."""
    for pid in descendants(os.getpid()):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    os._exit(128 + number)
