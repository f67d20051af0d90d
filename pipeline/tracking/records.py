"""Journals read back: one frozen record per stage run, whatever state its writer left it in."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from pipeline.tracking.journal import ARTIFACTS, EVENTS, LOCK, PARAMS, journals_folder
from pipeline.tracking.run import Pipeline


@dataclass(frozen=True)
class Point:
    """One value of one metric; times in ms since 1970."""

    name: str
    value: float
    time: int
    step: int


@dataclass(frozen=True)
class Record:
    """What one stage run left behind; times in ms since 1970."""

    folder: Path
    stage: str
    workspace: str
    pipeline: Pipeline
    params: Mapping[str, object]
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    points: tuple[Point, ...]
    artifacts: tuple[str, ...]
    start: int
    end: int
    status: str
    """``FINISHED``, ``FAILED``, ``RUNNING``, or ``KILLED``: no end, and nobody holds the lock."""
    error: str
    processor: str
    """Processor of the machine it ran on."""
    restored: Mapping[str, Mapping[str, str]]
    """Empty for a stage that ran. Otherwise no stage did: the stages whose outputs DVC took from
    its cache or found unchanged in this pipeline run, with the md5 of each output by path."""

    @property
    def id(self) -> str:
        """The journal's name, unique for ever."""
        return self.folder.name

    @property
    def params_file(self) -> Path:
        """The copy of params.yaml as it was when the stage started."""
        return self.folder / ARTIFACTS / PARAMS


def waiting_records(root: Path) -> list[Record]:
    """Read the journals that are not in MLflow yet, in the order their stages started."""
    return _records(journals_folder(root))


def shipped_records(root: Path) -> list[Record]:
    """Read the journals that are in MLflow, in the order their stages started."""
    return _records(journals_folder(root) / "done")


def unreadable_journals(root: Path) -> list[str]:
    """Say of each waiting journal that cannot be read why; it stays, and holds up no other."""
    found = [_attempt(folder) for folder in _folders(journals_folder(root))]
    return [answer for answer in found if isinstance(answer, str)]


def _records(parent: Path) -> list[Record]:
    found = [_attempt(folder) for folder in _folders(parent)]
    records = [answer for answer in found if isinstance(answer, Record)]
    return sorted(records, key=lambda record: (record.start, record.id))


def _folders(parent: Path) -> list[Path]:
    """List the folders of journals; ``done`` holds others and is none."""
    inside = sorted(parent.iterdir()) if parent.is_dir() else []
    return [path for path in inside if path.is_dir() and path.name != "done"]


def _attempt(folder: Path) -> Record | str | None:
    """Read one journal, or say why it cannot be read."""
    try:
        return read_record(folder)
    except (OSError, ValueError) as error:
        return f"journal {folder.name} cannot be read: {error}"


def read_record(folder: Path) -> Record | None:
    """Read one journal; None if no line was written whole.

    Raises:
        OSError: The file cannot be read.
        ValueError: Its lines do not say what the journals of this version say, or the first is gone.
    """
    try:
        events = list(_events(folder / EVENTS))
    except FileNotFoundError:
        return None  # its writer has only just made the folder
    if not events or events[0]["event"] != "start":
        if not events or is_held(folder / LOCK):
            return None
        raise ValueError("its first line, which says of what stage it is, was not written whole")
    try:
        return _record(folder, events)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"an entry is missing or of another kind: {error}") from error


def _record(folder: Path, events: list[dict[str, Any]]) -> Record:
    first = events[0]
    end = next((event for event in reversed(events) if event["event"] == "end"), None)
    status = end["status"] if end else "RUNNING" if is_held(folder / LOCK) else "KILLED"
    return Record(
        folder=folder,
        stage=first["stage"],
        workspace=first["workspace"],
        pipeline=Pipeline(**first["pipeline"]),
        params=first["params"],
        inputs=first["inputs"],
        outputs=next((event["outputs"] for event in events if event["event"] == "outputs"), {}),
        points=tuple(
            Point(name, value, event["time"], event["step"] or 0)
            for event in events
            if event["event"] == "metrics"
            for name, value in event["values"].items()
        ),
        artifacts=tuple(event["path"] for event in events if event["event"] == "artifact"),
        start=int(first["time"]),
        end=int((end or events[-1])["time"]),
        status=status,
        error=end["error"] if end else "",
        processor=first.get("processor", ""),
        restored=first.get("restored_stages") or {},
    )


def _events(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines that are whole; a killed or starved writer may have torn the last."""
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            event = json.loads(line)
        except ValueError:
            continue
        if isinstance(event, dict) and "event" in event:
            yield event


def is_held(lock: Path) -> bool:
    """Tell whether the holder of a lock is alive; the kernel frees it however that dies."""
    if not lock.exists():
        return False
    try:
        with FileLock(lock, blocking=False):
            return False
    except Timeout:
        return True
