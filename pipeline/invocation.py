"""Which pipeline run a process belongs to: the experiment, or the ``dvc`` command above it."""

import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

VARIABLE = "PCRDIFF_INVOCATION"
"""A launcher of several ``dvc repro -s`` sets this to ``process_identity(os.getpid())``."""


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
    """The commit checked out, empty outside git."""


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
    """Return what ``git`` prints, stripped; empty where git or the repository is missing."""
    command = ["git", *arguments]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def project_root() -> Path:
    """Return ``$DVC_ROOT`` (the main repository, also for ``--temp``), else git's top, else here."""
    root = os.environ.get("DVC_ROOT") or git("rev-parse", "--show-toplevel")
    return Path(root).resolve() if root else Path.cwd()


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
    told = Path(f"/proc/{pid}/stat").read_bytes()  # a name may be of any bytes
    return told.rpartition(b")")[2].decode("ascii").split()


def _ancestors() -> Iterator[int]:
    """Yield parent, grandparent, ...; nothing where there is no ``/proc``."""
    pid = os.getppid()
    while pid > 1:
        yield pid
        try:
            pid = int(_stat(pid)[1])
        except (OSError, IndexError):
            return


def _dvc_above() -> str:
    """Identify the topmost ``dvc`` command above this process; empty if there is none."""
    above = [pid for pid in _ancestors() if is_dvc(pid)]
    return process_identity(above[-1]) if above else ""


def is_dvc(pid: int) -> bool:
    """Tell whether the process runs ``dvc ...`` or ``python -m dvc ...``."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return False
    return any(Path(word).name == "dvc" for word in words[:3])
