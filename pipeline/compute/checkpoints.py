"""Where a killed training resumes from: beside the DVC outputs, never one of them."""

import hashlib
import json
import os
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import torch
from filelock import FileLock, Timeout
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from pipeline.tracking.journal import content_md5
from pipeline.tracking.run import project_root

LATEST = "latest.safetensors"
PREVIOUS = "previous.safetensors"
OWNER = "pid"
SECONDS_BETWEEN = 20.0
"""How much work a kill may cost; when a state is saved never changes what is trained."""
RECORD = "record"  # the only metadata key: with two or more, the bytes of a file would vary


class DiskCheckpoint:
    """The state of one training on disk; two generations, so that one is always whole."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._saved_at = time.monotonic()

    def due(self) -> bool:
        """Say whether the last state is old enough to be worth replacing."""
        return time.monotonic() - self._saved_at > SECONDS_BETWEEN

    def load(self) -> tuple[dict[str, torch.Tensor], dict[str, object]] | None:
        """Return the newest whole state (tensors on the CPU, record), or None at the start."""
        for path in (self.folder / LATEST, self.folder / PREVIOUS):
            if not path.exists():
                continue
            try:
                return _read(path)
            except (SafetensorError, KeyError, TypeError, ValueError, OSError) as error:
                _warn(f"ignored the damaged checkpoint {path}: {error}")
        return None

    def save(self, tensors: Mapping[str, torch.Tensor], record: Mapping[str, object]) -> None:
        """Replace the state by this one, atomically; a full disk keeps the old one and warns.

        Args:
            tensors: Weights, optimizer state, generator states; any device, dtypes are kept.
            record: Everything else, as JSON knows it (a tuple comes back as a list).

        Raises:
            ValueError: The record holds something JSON cannot.
        """
        try:
            text = json.dumps(record, sort_keys=True)
        except TypeError as error:
            raise ValueError(f"a checkpoint's record must be JSON: {error}") from error
        self._saved_at = time.monotonic()
        copies = {  # which share memory with nothing, as safetensors wants it
            name: tensor.detach().to("cpu", copy=True).contiguous()
            for name, tensor in tensors.items()
        }
        try:
            self._replace(copies, text)
        except (SafetensorError, OSError) as error:
            _warn(f"the state was not saved in {self.folder}, training continues: {error}")

    def _replace(self, tensors: dict[str, torch.Tensor], record: str) -> None:
        """Write under another name, sync to disk, then turn the generations."""
        new = self.folder / "new.safetensors"
        save_file(tensors, new, metadata={RECORD: record})
        _fsync(new)
        latest = self.folder / LATEST
        if latest.exists():
            latest.replace(self.folder / PREVIOUS)
        new.replace(latest)
        _fsync(self.folder)


class NoCheckpoint:
    """A training that is not resumed, or of a process beside the first, which keeps the state."""

    def due(self) -> bool:
        """Say that there is nothing to do."""
        return False

    def load(self) -> None:
        """Return nothing."""

    def save(self, tensors: Mapping[str, torch.Tensor], record: Mapping[str, object]) -> None:
        """Keep nothing."""


@contextmanager
def open_checkpoint(
    params: Mapping[str, object], deps: Sequence[Path], *, root: Path | None = None
) -> Iterator[DiskCheckpoint]:
    """Keep the checkpoint of the training that these params and inputs define.

    Args:
        params: All the training depends on; compared as JSON.
        deps: Files and folders it depends on, code and data; compared by their bytes.
        root: The project; by default DVC's, also from the folders of ``dvc exp run --temp``.

    Yields:
        The checkpoint, locked. It is removed when the ``with`` ends well, and kept when it ends
        by an exception or a kill.

    Raises:
        FileNotFoundError: One of ``deps`` is not there.
        ValueError: The params are not JSON, or another process trains with the same ones.
    """
    folder = checkpoints_folder(root or project_root()) / fingerprint(params, deps)
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder.with_suffix(".lock"), blocking=False)
    try:
        lock.acquire()
    except Timeout as error:
        same = f"another training with the same params and inputs is running ({_owner(folder)})"
        raise ValueError(f"{same}; it holds {lock.lock_file}") from error
    try:
        folder.mkdir(parents=True, exist_ok=True)  # the holder before may have just removed it
        (folder / OWNER).write_text(str(os.getpid()), encoding="ascii")
        yield DiskCheckpoint(folder)
        shutil.rmtree(folder)
        Path(lock.lock_file).unlink(missing_ok=True)
    finally:
        lock.release()


def fingerprint(params: Mapping[str, object], deps: Sequence[Path]) -> str:
    """Return the name of a training: sha256 of its stage, its params and what it depends on.

    The stage is part of it: variants of several ablations may have equal params, and run at once.
    """
    stage = os.environ.get("DVC_STAGE", "")
    try:
        described = json.dumps([stage, params], sort_keys=True)
    except TypeError as error:
        raise ValueError(f"a training's params must be JSON: {error}") from error
    for path in deps:
        if not path.exists():
            raise FileNotFoundError(f"the training depends on {path}, which is not there")
    here = Path.cwd()  # paths from it are the same in the folder of every ``dvc exp run --temp``
    paths = [path.relative_to(here) if path.is_relative_to(here) else path for path in deps]
    read = sorted([path.as_posix(), content_md5(path)] for path in paths)
    return hashlib.sha256(json.dumps([described, read]).encode()).hexdigest()


def checkpoints_folder(root: Path) -> Path:
    """Return where a project keeps its checkpoints, one folder a fingerprint."""
    return root / ".pcrdiff" / "checkpoints"


def _read(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, object]]:
    with safe_open(path, framework="pt") as file:
        record: dict[str, object] = json.loads(file.metadata()[RECORD])
        return {name: file.get_tensor(name).clone() for name in file.keys()}, record  # noqa: SIM118  no mapping


def _owner(folder: Path) -> str:
    try:
        return f"process {int((folder / OWNER).read_text(encoding='ascii'))}"
    except (OSError, ValueError):
        return "it has just started"


def _fsync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _warn(sentence: str) -> None:
    sys.stderr.write(f"pcrdiff checkpoint: {sentence}\n")
