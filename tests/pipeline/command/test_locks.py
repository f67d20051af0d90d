"""Who works in a project is said in one sentence; what was started ends with who started it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from dvc.lock import make_lock

from pipeline.command import real
from pipeline.command.doctor import check_dvc_files, check_others
from pipeline.command.locks import check_locks, only_repro
from pipeline.command.plan import plan_stages
from pipeline.command.repro import repro
from pipeline.tracking.run import descendants, is_running, process_identity

REPOSITORY = Path(__file__).parents[3]
START = f"import sys; sys.path.insert(0, {str(REPOSITORY)!r}); from pipeline.command.cli import app; app()"
SLOW = "echo $$ > pid-{0}; sleep 60; true"
DVC_YAML = f"""\
stages:
  one:
    cmd: {SLOW.format("one")}
    outs: [one]
  two:
    cmd: {SLOW.format("two")}
    outs: [two]
"""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("DVC_ROOT", raising=False)
    for words in (["git", "init", "--quiet"], [sys.executable, "-m", "dvc", "init", "--quiet"]):
        subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "dvc.yaml").write_text(DVC_YAML)
    (tmp_path / ".dvc" / "tmp").mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(real, "check_experiments", lambda _: None)
    return tmp_path


VERBS: dict[str, Callable[[Path], object]] = {
    "repro": lambda root: repro(root, [], jobs=1, tell=lambda _: None),
    "plan": lambda root: list(plan_stages(root, [])),
    "real": real.run_real,
    "doctor": lambda root: list(check_others(root)),
}
DAMAGED = {
    "empty": b"",
    "cut off": b'{"write": {"/x": {"pid": 1',
    "zeros": b"\0" * 64,
    "a list": b"[]",
    "without a process": b'{"write": {"/x": {"cmd": "dvc"}}}',
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("content", DAMAGED.values(), ids=list(DAMAGED))
def test_a_lock_file_that_dvc_cannot_read_is_named(
    project: Path, content: bytes, verb: str
) -> None:
    path = project / ".dvc" / "tmp" / "rwlock"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="empty or damaged; remove it") as refused:
        VERBS[verb](project)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("kind", ["read", "write"])
def test_files_that_another_dvc_holds_are_said_with_its_process(
    project: Path, kind: str, verb: str
) -> None:
    entry = {"pid": os.getpid(), "cmd": "dvc repro one"}
    noted = {kind: {str(project / "one"): entry if kind == "write" else [entry]}}
    (project / ".dvc" / "tmp" / "rwlock").write_text(json.dumps(noted))
    with pytest.raises(ValueError, match=rf"process {os.getpid()}, 'dvc repro one'.*wait"):
        VERBS[verb](project)


def test_what_dead_processes_held_and_empty_notes_stop_nobody(project: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    path = project / ".dvc" / "tmp" / "rwlock"
    for noted in ({}, {"write": {"/x": {"pid": child.pid, "cmd": "dvc"}}, "read": {"/y": []}}):
        path.write_text(json.dumps(noted))
        check_locks(project)
    path.unlink()
    assert [finding.level for finding in check_others(project)] == ["ok"]


UNREADABLE = {
    "a merge left half done": ("dvc.lock", b"<<<<<<< HEAD\nstages: {}\n=======\n>>>>>>> b\n"),
    "an empty lock file": ("dvc.lock", b""),
    "a lock file of another schema": ("dvc.lock", b"schema: '3.0'\nstages: {}\n"),
    "a lock file in Latin-1": ("dvc.lock", b"schema: '2.0'\n# Ma\xdfe\n"),
    "stages in conflict": ("dvc.yaml", b"<<<<<<< HEAD\nstages: {}\n=======\n>>>>>>> b\n"),
    "an ignore file in Latin-1": (".dvcignore", b"# Ma\xdfe\n"),
    "a config that is cut off": (".dvc/config", b"[core\n"),
    "a config of another DVC": (".dvc/config", b"[core]\n    novelty = 1\n"),
}
READING: dict[str, Callable[[Path], Any]] = {
    **{name: VERBS[name] for name in ("repro", "plan")},
    "doctor": check_dvc_files,
}


@pytest.mark.parametrize("verb", ["repro", "plan", "doctor"])
@pytest.mark.parametrize("kind", UNREADABLE)
def test_a_file_that_dvc_cannot_read_is_named_with_what_to_do(
    project: Path, kind: str, verb: str
) -> None:
    name, content = UNREADABLE[kind]
    (project / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"DVC cannot read .*git checkout HEAD -- FILE") as refused:
        list(READING[verb](project) or ())
    assert Path(name).name in str(refused.value)
    assert "\n" not in str(refused.value)
    assert (project / name).read_bytes() == content


HOLD = """\
import sys, time
from dvc.lock import make_lock
with make_lock(sys.argv[1]):
    print(1, flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("verb", VERBS)
def test_a_lock_that_another_dvc_holds_is_said_with_its_process(project: Path, verb: str) -> None:
    lock = project / ".dvc" / "tmp" / "lock"
    words = [sys.executable, "-c", HOLD, str(lock)]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(ValueError, match=rf"another DVC works in .*process {holder.pid}\)"):
            VERBS[verb](project)
        holder.kill()
    with make_lock(str(lock)):
        pass


def test_a_second_repro_is_refused_and_the_next_is_not(project: Path) -> None:
    refused = pytest.raises(ValueError, match=rf"`pcrdiff repro` .*process {os.getpid()}\): wait")
    with only_repro(project), refused:
        VERBS["repro"](project)
    with only_repro(project):
        pass


def heed_interrupts() -> None:
    """Undo what a shell does to its jobs in the background."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(project: Path) -> tuple[subprocess.Popen[bytes], list[str]]:
    """Start `pcrdiff repro` and wait until both stages run; give the identities of their shells."""
    words = [sys.executable, "-c", START, "repro", "-j", "2"]
    leader = subprocess.Popen(
        words, cwd=project, start_new_session=True, preexec_fn=heed_interrupts
    )
    files = [project / f"pid-{name}" for name in ("one", "two")]
    until = time.monotonic() + 120
    while not all(file.is_file() and file.read_text().strip() for file in files):
        assert leader.poll() is None
        assert time.monotonic() < until
        time.sleep(0.1)
    running = [*descendants(leader.pid), *(int(file.read_text()) for file in files)]
    identities = [process_identity(pid) for pid in running]
    assert all(map(is_running, identities))
    return leader, identities


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="finds processes by /proc")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGKILL])
def test_stages_end_with_the_repro_that_started_them(project: Path, number: int) -> None:
    leader, running = start(project)
    os.kill(leader.pid, number)
    leader.wait(30)
    until = time.monotonic() + 30
    while any(map(is_running, running)) and time.monotonic() < until:
        time.sleep(0.1)
    assert [one for one in running if is_running(one)] == []
    check_locks(project)
