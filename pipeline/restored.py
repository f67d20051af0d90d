"""Journals for the stages that ran no code, because DVC restored them or found them unchanged."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.invocation import Pipeline
from pipeline.records import Record
from pipeline.tracking import Journal, content_md5, header, journals_folder
from pipeline.yaml_files import read_yaml

LARGEST_METRICS_FILE = 1_000_000  # bytes; a larger JSON file is data, not metrics


def note_restored(root: Path, workspace: Path, pipeline: Pipeline, ran: Sequence[Record]) -> int:
    """Write a journal for each stage of ``dvc.lock`` that this pipeline run needed but did not run.

    The stages that did run get the md5 of their outputs noted. Nothing is written twice.

    Args:
        root: The project, whose journals are kept below it.
        workspace: The folder with the ``dvc.lock`` of this run.
        pipeline: The run of the pipeline.
        ran: The journals its stages left, shipped or not.

    Returns:
        How many journals were written.
    """
    lock = read_lock(workspace)
    if not _belongs(lock, ran):
        return 0
    names = {record.stage for record in ran}
    for record in ran:
        _note_outputs(record, lock)
    wanted = _needed(workspace, names, lock) - names
    return sum(_note(root, workspace, pipeline, name, lock[name]) for name in sorted(wanted))


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
        finished = record.status == "FINISHED" and not record.restored and record.stage != "report"
        if finished and any(locked.get(p, md5) != md5 for p, md5 in record.inputs.items()):
            return False
    return True


def _needed(workspace: Path, names: set[str], lock: Mapping[str, Any]) -> set[str]:
    """Return those stages of the lock that lead to the named ones; all if DVC cannot tell."""
    from dvc.exceptions import DvcException
    from dvc.repo import Repo

    try:
        with Repo(str(workspace)) as repo:
            graph = repo.index.graph
            pending = [stage for stage in graph if stage.addressing in names]
            found = set(pending)
            while pending:
                before = set(graph.successors(pending.pop())) - found
                found |= before
                pending += before
            return {stage.addressing for stage in found} & set(lock)
    except DvcException:
        return set(lock)


def _note(
    root: Path, workspace: Path, pipeline: Pipeline, stage: str, locked: Mapping[str, Any]
) -> bool:
    """Write the journal of one restored stage, unless it has one."""
    digest = hashlib.sha256(json.dumps([pipeline.key, stage]).encode()).hexdigest()
    folder = journals_folder(root) / f"restored-{digest[:24]}"
    if folder.exists() or (folder.parent / "done" / folder.name).exists():
        return False
    files = locked.get("params") or {}
    params = {key: value for keys in files.values() for key, value in keys.items()}
    notes = Journal(folder)
    start = header(stage, pipeline, params, _md5s(locked, "deps"))
    notes.append({**start, "workspace": str(workspace), "restored": True})
    outputs = _md5s(locked, "outs")
    notes.append({"event": "outputs", "outputs": outputs})
    for path, md5 in outputs.items():
        notes.metrics(dict(_numbers(workspace / path, md5)))
    notes.close("FINISHED")
    return True


def _note_outputs(record: Record, lock: Mapping[str, Any]) -> None:
    """Add the md5 of what a stage wrote to its journal, if that still waits."""
    outputs = _md5s(lock.get(record.stage, {}), "outs")
    waits = record.folder.parent.name != "done" and record.status == "FINISHED"
    if waits and outputs and not record.outputs and not record.restored:
        event = {"event": "outputs", "outputs": outputs, "time": record.end}
        with (record.folder / "journal.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(event) + "\n")


def _md5s(locked: Mapping[str, Any], kind: str) -> dict[str, str]:
    entries: Iterable[Mapping[str, Any]] = locked.get(kind) or []
    return {str(entry["path"]): str(entry["md5"]) for entry in entries if "md5" in entry}


def _numbers(path: Path, md5: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a JSON output, if the file is small and the one the lock names."""
    if path.suffix != ".json" or not path.is_file() or path.stat().st_size > LARGEST_METRICS_FILE:
        return
    if content_md5(path) == md5:
        yield from flat_numbers(json.loads(path.read_text(encoding="utf-8")))


def flat_numbers(values: object, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield ``a.b.c``, number for the numbers in nested mappings; nothing for the rest."""
    if isinstance(values, Mapping):
        for key, value in values.items():
            yield from flat_numbers(value, f"{prefix}.{key}" if prefix else str(key))
    elif isinstance(values, int | float) and not isinstance(values, bool) and prefix:
        yield prefix, float(values)
