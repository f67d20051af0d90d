"""Who works in the project already: said before the work begins, with what to do about it."""

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

from filelock import FileLock, Timeout

from pipeline.tracking.run import process_identity

OWNER = "repro.owner"
PATIENCE = 3.0  # seconds in which one who only looks has finished


def check_locks(root: Path) -> None:
    """Check that DVC can take its locks in this project.

    Raises:
        ValueError: Another DVC works here, or one that was cut off left a file DVC cannot read.
    """
    folder = root / ".dvc" / "tmp"
    if not folder.is_dir():
        return
    for name in ("lock", "rwlock.lock"):
        with _holding(folder / name):
            if name == "rwlock.lock":  # DVC rewrites rwlock under it
                _check_rwlock(folder / "rwlock")


@contextmanager
def _holding(path: Path) -> Iterator[None]:
    """Hold one of the locks of DVC, whose manual says that they are those of ``flock``."""
    until = time.monotonic() + PATIENCE
    with path.open("ab") as file:
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() > until:
                    owner = path.read_text(errors="replace").strip() or "unknown"
                    who = f"another DVC works in {path.parents[2]} (process {owner})"
                    raise ValueError(f"{who}: wait until it has ended, or end it") from error
            time.sleep(0.1)
        yield


@contextmanager
def only_repro(root: Path) -> Iterator[None]:
    """Be the one `pcrdiff repro` in this project.

    Raises:
        ValueError: There is one already.
    """
    folder = root / ".pcrdiff"
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / "repro.lock", blocking=False)
    try:
        lock.acquire()
    except Timeout as error:
        owner = (folder / OWNER).read_text() if (folder / OWNER).exists() else "unknown"
        who = f"another `pcrdiff repro` works in {root} (process {owner})"
        raise ValueError(f"{who}: wait until it has ended, or end it") from error
    try:
        (folder / OWNER).write_text(str(os.getpid()))
        yield
    finally:
        lock.release()


def _check_rwlock(path: Path) -> None:
    try:
        holders = _holders(path.read_bytes())
    except FileNotFoundError:
        return
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        cause = "a DVC that was cut off, or a full disk, left it empty or damaged"
        raise ValueError(f"DVC cannot read {path}: {cause}; remove it") from error
    for pid, command in holders.items():
        if process_identity(pid):
            who = f"another DVC holds files of this project (process {pid}, {command!r})"
            remedy = f"wait until it has ended; if that process is something else, remove {path}"
            raise ValueError(f"{who}: {remedy}")


def _holders(content: bytes) -> dict[int, str]:
    """Process ids and commands that DVC has noted as readers and writers."""
    noted = json.loads(content)
    readers = chain.from_iterable(noted.get("read", {}).values())
    entries = [*noted.get("write", {}).values(), *readers]
    return {int(entry["pid"]): str(entry["cmd"]) for entry in entries}
