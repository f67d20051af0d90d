"""The journal: what a stage leaves on disk for MLflow, without importing MLflow.

A journal is a folder ``<root>/.pcrdiff/journal/<id>/`` with ``journal.jsonl`` (one event a line,
flushed, so that a killed stage leaves a readable one), ``artifacts/`` (copies, of params.yaml too:
the workspace of ``dvc exp run --temp`` is gone when they are read) and ``lock`` (held while the stage lives).
Writing it never makes a stage fail: what cannot be written becomes a warning on stderr.
"""

import hashlib
import json
import os
import platform
import secrets
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

from filelock import FileLock

from pipeline.tracking.dvcignore import seen_files
from pipeline.tracking.run import Pipeline, current_pipeline, project_root

EVENTS = "journal.jsonl"
ARTIFACTS = "artifacts"
LOCK = "lock"
PARAMS = "params.yaml"


class Journal:
    """Notes of one stage run; each is on disk when the call returns."""

    def __init__(self, folder: Path) -> None:
        """Start an empty journal in a new folder; broken from the start if that cannot be made."""
        self.folder = folder
        self._file: TextIO | None = None
        self._lock = FileLock(folder / LOCK)
        try:
            folder.mkdir(parents=True)
            self._lock.acquire(blocking=False)
            self._file = (folder / EVENTS).open("a", encoding="utf-8")
        except (OSError, NotImplementedError) as error:
            _warn(f"nothing of this stage will reach MLflow: {error}")

    def metrics(self, values: Mapping[str, float], step: int | None = None) -> None:
        """Note numbers; ``step`` (an epoch, say) makes each a point of a curve."""
        try:
            numbers = {name: float(value) for name, value in values.items()}
        except (TypeError, ValueError) as error:
            _warn(f"the metrics {sorted(values)} are not all numbers: {error}")
            return
        self.append({"event": "metrics", "values": numbers, "step": step})

    def artifact(self, path: Path) -> None:
        """Copy a file or folder into the journal, and note it for the stage's run."""
        name = self.keep(path)
        if name:
            self.append({"event": "artifact", "path": name.as_posix()})

    def keep(self, path: Path) -> Path | None:
        """Copy a file or folder into the journal.

        Returns:
            Its path there, which is the one relative to the workspace; None if it was not kept.
        """
        absolute = Path(path).resolve()
        inside = absolute.is_relative_to(Path.cwd().resolve())
        name = absolute.relative_to(Path.cwd().resolve()) if inside else Path(absolute.name)
        copy = self.folder / ARTIFACTS / name
        try:
            copy.parent.mkdir(parents=True, exist_ok=True)
            if absolute.is_dir():
                shutil.copytree(absolute, copy, dirs_exist_ok=True)
            else:
                shutil.copyfile(absolute, copy)
        except OSError as error:
            _warn(f"the artifact {path} was not kept: {error}")
            return None
        return name

    def append(self, event: Mapping[str, object]) -> None:
        """Write one event, stamped with the time in ms since 1970."""
        if self._file is None:
            return
        now = time.time_ns() // 1_000_000
        try:
            self._file.write(json.dumps({"time": now, **event}, default=str) + "\n")
            self._file.flush()
        except (OSError, TypeError, ValueError) as error:
            _warn(f"an event of kind {event.get('event')} was not kept: {error}")

    def close(self, status: str, error: str = "") -> None:
        """Write how it ended (``FINISHED``, ``FAILED``) and let go of the lock."""
        self.append({"event": "end", "status": status, "error": error})
        try:
            if self._file is not None:
                self._file.close()
        except OSError as problem:
            _warn(f"the journal was not closed: {problem}")
        self._lock.release()


@contextmanager
def journal(*, params: Mapping[str, object], inputs: Sequence[Path] = ()) -> Iterator[Journal]:
    """Keep a journal of the stage that runs inside the ``with``.

    Args:
        params: What the stage was given; few, since each is a column of MLflow's table.
        inputs: Files and folders it reads; their md5, as DVC computes it, is noted.

    Yields:
        The journal, for metrics and artifacts. An exception ends it as FAILED and is raised again.
    """
    stage = os.environ.get("DVC_STAGE") or Path(sys.argv[0]).stem or "python"
    notes = Journal(journals_folder(project_root()) / new_id(stage))
    start = header(stage, current_pipeline(), params, _digests(inputs))
    notes.append({**start, "processor": processor()})
    if Path(PARAMS).is_file():
        notes.keep(Path(PARAMS))
    try:
        yield notes
    except SystemExit as error:
        failed = error.code not in (None, 0)
        notes.close("FAILED" if failed else "FINISHED", f"exit {error.code}" if failed else "")
        raise
    except BaseException as error:
        notes.close("FAILED", f"{type(error).__name__}: {error}")
        raise
    notes.close("FINISHED")


def header(
    stage: str, pipeline: Pipeline, params: Mapping[str, object], inputs: Mapping[str, str]
) -> dict[str, object]:
    """Return the first event of a journal."""
    where = {"workspace": str(Path.cwd()), "pipeline": asdict(pipeline)}
    return {"event": "start", "stage": stage, **where, "params": params, "inputs": inputs}


def journals_folder(root: Path) -> Path:
    """Return where the journals of a project wait; those already in MLflow are below ``done``."""
    return root / ".pcrdiff" / "journal"


def new_id(stage: str) -> str:
    """Return a name no other journal has, which sorts by time."""
    safe = "".join(c if c.isalnum() or c in "-_." else "-" for c in stage)
    stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime())
    return f"{stamp}-{safe}-{os.getpid()}-{secrets.token_hex(4)}"


def content_md5(path: Path) -> str:
    """Return the md5 that ``dvc.lock`` would show: of a file, or ``<md5>.dir`` of a folder."""
    if path.is_dir():
        names = [(file.relative_to(path).as_posix(), file) for file in seen_files(path)]
        listed = [{"md5": content_md5(file), "relpath": name} for name, file in sorted(names)]
        return hashlib.md5(json.dumps(listed, sort_keys=True).encode()).hexdigest() + ".dir"
    with path.open("rb") as file:
        return hashlib.file_digest(file, "md5").hexdigest()


def processor() -> str:
    """Return the name of this machine's processor; what it computes may depend on it."""
    try:
        described = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return platform.processor() or platform.machine()
    names = [
        line.partition(":")[2].strip() for line in described.splitlines() if "model name" in line
    ]
    return names[0] if names else platform.machine()


def _digests(inputs: Sequence[Path]) -> dict[str, str]:
    """Return path -> md5 of those inputs that can be read; the stage will miss the others itself."""
    digests = {}
    for path in map(Path, inputs):
        try:
            digests[path.as_posix()] = content_md5(path)
        except (OSError, ValueError) as error:
            _warn(f"no md5 of the input {path}: {error}")
    return digests


def _warn(sentence: str) -> None:
    try:
        sys.stderr.write(f"pcrdiff journal: {sentence}\n")
    except OSError:
        return  # stderr is a full disk too; the stage matters more
