"""What DVC restored from its cache or found unchanged, read from ``dvc.lock``: no code of it ran."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.formats.yaml_files import read_yaml
from pipeline.tracking.journal import EVENTS, Journal, header, journals_folder
from pipeline.tracking.records import Record
from pipeline.tracking.run import Pipeline

REPORT = "report"
"""The stage that sends the journals, so that its own entry in ``dvc.lock`` is that of an earlier run."""


def note_restored(root: Path, workspace: Path, pipeline: Pipeline, ran: Sequence[Record]) -> None:
    """Write one journal of the stages that this pipeline run needed but did not run.

    The stages that did run get the md5 of their outputs noted. Nothing is written twice.

    Args:
        root: The project, whose journals are kept below it.
        workspace: The folder with the ``dvc.lock`` of this run.
        pipeline: The run of the pipeline.
        ran: The journals its stages left, shipped or not.
    """
    lock = read_lock(workspace)
    if not _belongs(lock, ran):
        return
    for record in ran:
        _note_outputs(record, lock)
    digest = hashlib.sha256(pipeline.key.encode()).hexdigest()
    folder = journals_folder(root) / f"restored-{digest[:24]}"
    restored = {name: _md5s(lock[name], "outs") for name in sorted(_needed(ran, lock))}
    if not restored or folder.exists() or (folder.parent / "done" / folder.name).exists():
        return
    notes = Journal(folder)
    notes.append({**header("restored", pipeline, {}, {}), "restored_stages": restored})
    notes.close("FINISHED")


def read_lock(workspace: Path) -> dict[str, Any]:
    """Return the stages of ``dvc.lock``; none if there is no such file yet."""
    path = workspace / "dvc.lock"
    if not path.is_file():
        return {}
    try:
        return dict((read_yaml(path) or {}).get("stages") or {})
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is not a dvc.lock: {error}") from error


def _belongs(lock: Mapping[str, Any], ran: Sequence[Record]) -> bool:
    """Tell whether the lock is still the one of these stage runs: same md5 of what they read."""
    for record in ran:
        locked = _md5s(lock.get(record.stage, {}), "deps")
        finished = record.status == "FINISHED" and record.stage != REPORT
        if finished and any(locked.get(p, md5) != md5 for p, md5 in record.inputs.items()):
            return False
    return True


def _needed(ran: Sequence[Record], lock: Mapping[str, Any]) -> set[str]:
    """Return the stages of the lock that the ones that ran read from, directly or not.

    A stage that is not in the lock yet reads what its journal says; the report reads everything.
    """
    names = {record.stage for record in ran}
    if REPORT in names - set(lock):
        return set(lock) - names
    pending = [path for record in ran for path in record.inputs]
    pending += [path for name in names & set(lock) for path in _md5s(lock[name], "deps")]
    found: set[str] = set()
    while pending:
        read = pending.pop()
        makers = {name for name in lock if any(_meet(read, p) for p in _md5s(lock[name], "outs"))}
        new = makers - found
        found |= new
        pending += [path for name in new for path in _md5s(lock[name], "deps")]
    return found - names


def _meet(read: str, written: str) -> bool:
    """Tell whether one path is the other or lies below it."""
    first, second = f"{read}/", f"{written}/"
    return first.startswith(second) or second.startswith(first)


def _note_outputs(record: Record, lock: Mapping[str, Any]) -> None:
    """Add the md5 of what a stage wrote to its journal, if that still waits."""
    outputs = _md5s(lock.get(record.stage, {}), "outs")
    waits = record.folder.parent.name != "done" and record.status == "FINISHED"
    if waits and outputs and not record.outputs and record.stage != REPORT:
        event = {"event": "outputs", "outputs": outputs, "time": record.end}
        with (record.folder / EVENTS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(event) + "\n")


def _md5s(locked: Mapping[str, Any], kind: str) -> dict[str, str]:
    entries: Iterable[Mapping[str, Any]] = locked.get(kind) or []
    return {str(entry["path"]): str(entry["md5"]) for entry in entries if "md5" in entry}
