"""Which pipeline run a process belongs to: the experiment, or the ``dvc`` command above it."""

import os
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

VARIABLE = "PCRDIFF_INVOCATION"
"""A launcher of several ``dvc repro -s`` sets this to ``process_identity(os.getpid())``."""

SHELL = "/bin/sh"
"""The shell that our own verbs have DVC use; its default is ``$SHELL``, which may be nologin."""
NOTHING_THERE = ("not a git repository (or any", "ambiguous argument 'HEAD'", "bad revision 'HEAD'")
"""How git's answer begins where there is no repository, or none with a commit."""


@dataclass(frozen=True)
class Pipeline:
    """One run of the pipeline, as far as a stage can tell from where it was started."""

    key: str
    """Equal for all stages of one run: ``exp:<name>@<rev>``, ``repro:<invocation>``, ``manual@<rev>``."""
    name: str
    """For people: the experiment's name, or ``repro@<short revision>``."""
    experiment: str
    """``DVC_EXP_NAME``, empty outside ``dvc exp run``."""
    baseline: str
    """``DVC_EXP_BASELINE_REV``, empty outside ``dvc exp run``."""
    invocation: str
    """Identity of the command that started it all, empty where none is known."""
    revision: str
    """The commit checked out; empty outside git, and where git refuses."""


def current_pipeline() -> Pipeline:
    """Tell the pipeline run of this process from DVC's variables, git and the process tree."""
    experiment = os.environ.get("DVC_EXP_NAME", "")
    baseline = os.environ.get("DVC_EXP_BASELINE_REV", "")
    invocation = os.environ.get(VARIABLE) or _dvc_above()
    revision = git("rev-parse", "HEAD")
    short = revision[:7] or "nogit"
    if experiment:
        key, name = f"exp:{experiment}@{baseline[:7]}", f"{experiment}@{baseline[:7]}"
    elif invocation:  # not the revision: someone may commit while a long training runs
        key, name = f"repro:{invocation}", f"repro@{short}"
    else:
        kind = "repro" if "DVC_STAGE" in os.environ else "manual"
        key = name = f"{kind}@{short}"
    return Pipeline(key, name, experiment, baseline, invocation, revision)


def git(*arguments: str, folder: Path | None = None) -> str:
    """Return what ``git`` prints, stripped; empty, and the reason on stderr, where it refuses."""
    try:
        return ask_git(*arguments, folder=folder)
    except ValueError as error:
        _say(str(error))
        return ""


def ask_git(*arguments: str, folder: Path | None = None) -> str:
    """Return what ``git`` prints, stripped; empty where git, the repository or a commit is missing.

    Raises:
        ValueError: Git refuses, since the folder is another user's, say; the sentence is git's own.
    """
    command = ["git", *arguments]
    english = {**os.environ, "LC_ALL": "C"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=english, capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    said = " ".join(done.stderr.split()).removeprefix("fatal: ")
    if done.returncode and said and not said.startswith(NOTHING_THERE):
        raise ValueError(f"git refuses {folder or Path.cwd()}: {said}")
    return done.stdout.strip() if done.returncode == 0 else ""


def check_experiments(root: Path) -> None:
    """Check that DVC can keep what an experiment computes, which it does as commits beside HEAD.

    Raises:
        ValueError: It cannot, and would say so after the work or never; with the remedy.
    """
    needs = "`dvc exp` keeps its results as git commits"
    if not shutil.which("git"):
        raise ValueError(f"{needs}, and there is no git on PATH: install it")
    shallow = ask_git("rev-parse", "--is-shallow-repository", folder=root)
    if not shallow:
        raise ValueError(f"{needs}, and {root} is not a git repository: clone it, or `git init`")
    if not ask_git("rev-parse", "HEAD", folder=root):
        raise ValueError(f"{needs}, and {root} has no commit yet: `git commit` first")
    if shallow == "true":
        lost = "a shallow clone, in which they are lost: run `git fetch --unshallow`"
        raise ValueError(f"{needs}, and {root} is {lost}")
    for name in ("name", "email"):
        given = os.environ.get(f"GIT_COMMITTER_{name.upper()}")
        if not (given or ask_git("config", f"user.{name}", folder=root)):
            raise ValueError(f"{needs}, and git has no user.{name}: `git config user.{name} ...`")


@cache
def _say(sentence: str) -> None:
    """Tell it on stderr, once a process."""
    sys.stderr.write(f"pcrdiff: {sentence}\n")


def project_root() -> Path:
    """Return ``$DVC_ROOT`` (the main repository, also for ``--temp``), else the project around here.

    Git is not asked: the project may lie inside another repository, or in none.

    Raises:
        FileNotFoundError: Neither this folder nor one above it is a project.
    """
    given = os.environ.get("DVC_ROOT")
    if given:
        return Path(given).resolve()
    here = Path.cwd()
    for folder in (here, *here.parents):
        if (folder / "dvc.yaml").is_file() and (folder / ".dvc").is_dir():
            return folder
    needed = "a folder with the project's dvc.yaml and .dvc is needed here or above"
    raise FileNotFoundError(f"{needed}, {here} has none: go to the project, or set DVC_ROOT to it")


def process_identity(pid: int) -> str:
    """Name a process so that no later one, before or after a reboot, gets the same name.

    Returns:
        ``<boot>-<pid>-<start tick>``; empty where ``/proc`` does not tell (not Linux, or gone).
    """
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")[:8]
        return f"{boot}-{pid}-{_stat(pid)[19]}"
    except (OSError, IndexError):
        return ""


def is_running(identity: str) -> bool:
    """Tell whether the process that ``process_identity`` named is still there."""
    parts = identity.split("-")
    return len(parts) == 3 and parts[1].isdigit() and process_identity(int(parts[1])) == identity


def _stat(pid: int) -> list[str]:
    """Return the fields of ``/proc/<pid>/stat`` after the name: state, parent, ..., start tick."""
    stat = Path(f"/proc/{pid}/stat").read_bytes()  # a name may be of any bytes
    return stat.rpartition(b")")[2].decode("ascii").split()


def descendants(pid: int) -> list[int]:
    """Return what a process has started, and what those have; nothing where there is no ``/proc``."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, IndexError):  # it has just ended
            parents[int(folder.name)] = int(_stat(int(folder.name))[1])
    found = [pid]
    for above in found:  # which grows
        found += [child for child, parent in parents.items() if parent == above]
    return found[1:]


def _dvc_above() -> str:
    """Identify the topmost ``dvc`` command above this process; empty if there is none."""
    pid, topmost = os.getppid(), 0
    with suppress(OSError, IndexError):  # no `/proc`, or gone
        while pid > 1:
            topmost = pid if is_dvc(pid) else topmost
            pid = int(_stat(pid)[1])
    return process_identity(topmost) if topmost else ""


def is_dvc(pid: int) -> bool:
    """Tell whether the process runs ``dvc ...`` or ``python -m dvc ...``."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return False
    return any(Path(word).name == "dvc" for word in words[:3])
