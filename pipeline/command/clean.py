"""What killed runs leave behind: which of it is dead, and how to remove it."""

import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.tracking.journal import journals_folder
from pipeline.tracking.records import is_held
from pipeline.tracking.run import is_dvc

SETTLING_SECONDS = 600.0  # DVC makes a folder some time before it works in it


@dataclass(frozen=True)
class Leftover:
    """A folder nobody needs any more."""

    path: Path
    what: str


def leftovers(root: Path, *, days: float) -> list[Leftover]:
    """List what ``pcrdiff clean`` removes.

    Args:
        root: The project.
        days: Checkpoints touched since then are kept: their trainings can still resume.
    """
    shipped = (journals_folder(root) / "done").glob("*/")
    return [
        *(Leftover(path, "folder of a dead experiment") for path in dead_experiments(root)),
        *(Leftover(path, "old checkpoint") for path in _old_checkpoints(root, days)),
        *(Leftover(path, "journal that is in MLflow") for path in sorted(shipped)),
    ]


def remove(leftover: Leftover) -> None:
    """Delete a leftover; a checkpoint goes with its lock file."""
    shutil.rmtree(leftover.path)
    lock_of(leftover.path).unlink(missing_ok=True)


def dead_experiments(root: Path) -> Iterator[Path]:
    """Yield the temporary folders of ``dvc exp run --temp`` that a killed run left.

    None while any ``dvc`` command works in the project, and none where ``/proc`` cannot tell.
    """
    working = list(_working_folders())
    busy = any(is_dvc(pid) and path.is_relative_to(root.resolve()) for pid, path in working)
    if busy or not working:
        return
    for folder in sorted((root / ".dvc" / "tmp" / "exps" / "standalone").glob("tmp*")):
        settled = time.time() - folder.stat().st_mtime > SETTLING_SECONDS
        if settled and not any(path.is_relative_to(folder.resolve()) for _, path in working):
            yield folder


def _working_folders() -> Iterator[tuple[int, Path]]:
    """Yield process id and working folder of every process of this user."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            yield int(process.name), (process / "cwd").readlink()
        except OSError:
            continue  # gone, or another user's


def _old_checkpoints(root: Path, days: float) -> Iterator[Path]:
    """Yield the checkpoints that no process holds and nothing has touched for so long."""
    for folder in sorted((root / ".pcrdiff" / "checkpoints").glob("*/")):
        age = time.time() - max(path.stat().st_mtime for path in [folder, *folder.iterdir()])
        if age >= days * 86400 and not is_held(lock_of(folder)):
            yield folder


def lock_of(folder: Path) -> Path:
    """Return the lock file beside a checkpoint's folder."""
    return folder.parent / f"{folder.name}.lock"
