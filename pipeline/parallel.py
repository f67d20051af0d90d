"""`dvc repro` with several stages at once. DVC itself runs one after the other.

Each stage is run by DVC's own code in a forked process, so that skipping, the run cache and the
commit of outputs are DVC's. What DVC would do after every single stage, reading and writing the
whole of dvc.lock, is done here for several stages together: with some two hundred stages each
such rewrite takes longer than many a stage. A stage that ended before its lock entry was written
(the machine went down, say) is in DVC's run cache and costs nothing the next time.
"""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NoReturn

import networkx as nx
from dvc.exceptions import DvcException
from dvc.stage.serialize import to_lockfile
from dvc.utils.serialize import dumps_yaml, parse_yaml

from pipeline.artifacts import write_atomically
from pipeline.invocation import SHELL, VARIABLE, descendants, process_identity
from pipeline.locks import check_locks, only_repro
from pipeline.planning import named, open_repo, stage_name, stale_manifests
from pipeline.warm import commands_in_forks, preload

LOCK_EVERY = 600.0  # seconds between two writes of dvc.lock, each of which takes some itself
LAST_LINES = 15  # of a failed stage's output that are shown
ALONE = "alone"
"""A stage with ``meta: {alone: true}`` runs while no other does: it measures time."""
FORK = get_context("fork")


@dataclass(frozen=True)
class Finished:
    """One stage that was run or taken from DVC's cache."""

    stage: str
    seconds: float
    """On the wall."""
    cpu_seconds: float
    """Of all its processes, DVC's part of the work included."""


@dataclass
class Running:
    """A stage on its way."""

    stage: Any
    process: BaseProcess
    answer: Connection
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
    with only_repro(root), exiting_on_signals():
        check_locks(root)
        try:
            return _repro(root, targets, jobs, tell)
        except DvcException as error:
            raise ValueError(str(error)) from error


def _repro(
    root: Path, targets: Sequence[str], jobs: int, tell: Callable[[Finished], None]
) -> list[Finished]:
    os.environ[VARIABLE] = process_identity(os.getpid())
    os.environ["SHELL"] = SHELL
    repo = open_repo(root, wait=True)
    graph = wanted_graph(repo.index.graph, targets)
    for manifest in stale_manifests(root, graph):
        manifest.unlink()  # DVC sees that, and has the data set acquired again
    lock = LockFile(repo, [stage_name(stage) for stage in repo.index.stages])
    launcher = Launcher(repo, graph, lock, root / ".pcrdiff" / "logs")
    finished: list[Finished] = []
    try:
        for ended in launcher.run(jobs):
            tell(ended)
            finished.append(ended)
    except (KeyboardInterrupt, SystemExit):
        launcher.end()
        raise
    finally:
        lock.write()
    return finished


@contextmanager
def exiting_on_signals() -> Iterator[None]:
    """Leave by an exception when told to end, so that what was started is ended too."""
    told = (signal.SIGTERM, signal.SIGHUP)
    mine = [number for number in told if signal.getsignal(number) == signal.SIG_DFL]  # not nohup's
    for number in mine:
        signal.signal(number, _exit)
    try:
        yield
    finally:
        for number in mine:
            signal.signal(number, signal.SIG_DFL)


def _exit(number: int, _frame: object) -> NoReturn:
    sys.exit(128 + number)


def timings(finished: Iterable[Finished]) -> list[str]:
    """What the stages took, as a table: a line for each group of dvc.yaml, and its longest."""
    groups: dict[str, list[Finished]] = {}
    for one in finished:
        groups.setdefault(one.stage.partition("@")[0], []).append(one)
    lines = [f"{'':20} {'count':>5} {'total s':>8} {'CPU s':>8} {'longest s':>9}"] if groups else []
    for name, members in groups.items():
        longest = max(members, key=lambda one: one.seconds)
        total, cpu = (sum(getattr(m, kind) for m in members) for kind in ("seconds", "cpu_seconds"))
        which = longest.stage.partition("@")[2]
        numbers = f"{len(members):5} {total:8.1f} {cpu:8.1f} {longest.seconds:9.1f}"
        lines.append(f"{name:20} {numbers}  {which}")
    return lines


def wanted_graph(graph: Any, targets: Sequence[str]) -> Any:  # noqa: ANN401  networkx ships no types
    """The part of DVC's graph (from a stage to those it needs) that the targets need."""
    if not targets:
        return graph
    wanted = {stage for name in targets for stage in named(graph.nodes, name)}
    return graph.subgraph(wanted.union(*(nx.descendants(graph, stage) for stage in wanted)))


def by_urgency(graph: Any) -> list[Any]:  # noqa: ANN401  networkx ships no types
    """What most stages wait for comes first, of equals what needs most itself.

    So trainings go before evaluations, and the many small evaluations fill the end.
    """
    stages = list(nx.dfs_postorder_nodes(graph))
    waiting = {stage: len(nx.ancestors(graph, stage)) for stage in stages}
    needed = {stage: len(nx.descendants(graph, stage)) for stage in stages}
    return sorted(stages, key=lambda stage: (-waiting[stage], -needed[stage]))


class LockFile:
    """dvc.lock, written now and then instead of after every stage."""

    def __init__(self, repo: Any, order: Iterable[str]) -> None:  # noqa: ANN401  DVC's own
        """``order`` of the entries: that of dvc.yaml, whichever stage ended first."""
        self.repo, self.path = repo, Path(repo.root_dir, "dvc.lock")
        self.place = {name: index for index, name in enumerate(order)}
        self.waiting: dict[str, Any] = {}
        self.written = time.monotonic()

    def add(self, entry: Mapping[str, Any]) -> None:
        """Keep the entry of a stage for the next write."""
        self.waiting.update(entry)

    def is_due(self) -> bool:
        """Whether entries have waited long enough."""
        return bool(self.waiting) and time.monotonic() - self.written > LOCK_EVERY

    def write(self) -> None:
        """Write the entries that wait; those of stages that dvc.yaml has lost stay at the end."""
        if not self.waiting:
            return
        with self.repo.lock:
            text = self.path.read_text(encoding="utf-8") if self.path.is_file() else ""
            content = parse_yaml(text, str(self.path)) or {"schema": "2.0"}
            stages = {**content.get("stages", {}), **self.waiting}
            ordered = sorted(stages, key=lambda name: self.place.get(name, len(self.place)))
            content["stages"] = {name: stages[name] for name in ordered}
            write_atomically(self.path, dumps_yaml(content).encode())
        self.waiting, self.written = {}, time.monotonic()


class Launcher:
    """Starts stages as those they need have ended."""

    def __init__(self, repo: Any, graph: Any, lock: LockFile, logs: Path) -> None:  # noqa: ANN401
        self.repo, self.graph, self.lock, self.logs = repo, graph, lock, logs
        self.pending = by_urgency(graph)
        self.ended: set[Any] = set()
        self.running: list[Running] = []
        self.failure = ""

    def run(self, jobs: int) -> Iterator[Finished]:
        """Run everything; yields each stage that was not up to date as it ends."""
        try:
            while self.pending or self.running:
                self._start(jobs)
                if self.running:
                    yield self._reap()
                if self.failure and not self.running:
                    raise ValueError(self.failure)
        except Exception:
            for one in self.running:
                one.process.join()
            raise

    def end(self) -> None:
        """Kill what runs, with all that it has started."""
        for pid in descendants(os.getpid()):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        for one in self.running:
            one.process.kill()  # where processes cannot be listed
            one.process.join()

    def _start(self, jobs: int) -> None:
        """Start what can be started; stages that are up to date end at once."""
        while not self.failure and len(self.running) < jobs:
            stage = next(filter(self._is_ready, self.pending), None)
            if stage is None:
                return
            self.pending.remove(stage)
            if self.lock.is_due() or not self._is_needed(stage):
                self.lock.write()  # what is needed by no other reports on all of them
            with self.repo.lock:
                changed = stage.changed()
            if changed:
                self.running.append(self._fork(stage))
            else:
                self.ended.add(stage)

    def _is_ready(self, stage: Any) -> bool:  # noqa: ANN401  DVC's own stage
        beside = [one.stage for one in self.running]
        if beside and (_is_alone(stage) or any(map(_is_alone, beside))):
            return False
        return self.ended.issuperset(self.graph.successors(stage))

    def _is_needed(self, stage: Any) -> bool:  # noqa: ANN401  DVC's own stage
        return any(True for _ in self.graph.predecessors(stage))

    def _fork(self, stage: Any) -> Running:  # noqa: ANN401  DVC's own stage
        preload()
        log = self.logs / f"{stage_name(stage)}.log"
        log.parent.mkdir(parents=True, exist_ok=True)
        ours, theirs = FORK.Pipe(duplex=False)
        process = FORK.Process(target=reproduce, args=(self.repo, stage, theirs, log))
        process.start()
        theirs.close()
        return Running(stage, process, ours, log)

    def _reap(self) -> Finished:
        """Wait for the next stage to end."""
        ready = wait([one.process.sentinel for one in self.running])
        one = next(one for one in self.running if one.process.sentinel in ready)
        self.running.remove(one)
        one.process.join()
        name = stage_name(one.stage)
        try:
            entry, cpu_seconds = one.answer.recv()
        except EOFError:  # it ended without a word: DVC, or the stage, refused or was killed
            said = one.log.read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
            self.failure = "\n".join([f"stage {name} failed; the end of {one.log}:", *said])
            cpu_seconds = 0.0
        else:
            self.lock.add(entry)
            self.ended.add(one.stage)
        return Finished(name, time.monotonic() - one.start, cpu_seconds)


def _is_alone(stage: Any) -> bool:  # noqa: ANN401  DVC's own stage
    return bool((stage.meta or {}).get(ALONE))


def reproduce(repo: Any, stage: Any, answer: Connection, log: Path) -> None:  # noqa: ANN401
    """In a process of its own: let DVC run the stage or restore it, and send its lock entry."""
    from pipeline.machine import end_with_parent  # it loads PyTorch: here that is there already

    end_with_parent()
    with log.open("w", buffering=1, encoding="utf-8", errors="surrogateescape") as file:
        os.dup2(file.fileno(), sys.stdout.fileno())
        os.dup2(file.fileno(), sys.stderr.fileno())
        with redirect_stdout(file), redirect_stderr(file):
            try:
                with repo.lock, nullcontext() if _is_alone(stage) else commands_in_forks():
                    stage.reproduce()
                answer.send((to_lockfile(stage), sum(os.times()[:4])))
            except DvcException as error:
                file.write(f"{error}\n")
