"""What `dvc repro` would run. DVC's own ``--dry`` stops at the first input that is yet to be made."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pcrdiff.datasets.manifest import MANIFEST, is_stale
from pipeline.command.graph import Needs, ask_dvc, by_urgency, group_of, stage_needs, wanted
from pipeline.command.locks import check_locks
from pipeline.formats.yaml_files import read_yaml
from pipeline.tracking.restored import read_lock


def plan_stages(root: Path, targets: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield ``(stage, why)`` in the order in which they would run.

    Args:
        root: The project.
        targets: Stages, or groups such as ``train``, with all they need; none means all.

    Raises:
        ValueError: No such stage, no DVC project, or somebody else works in it.
    """
    check_locks(root)
    yield from outdated(root, wanted(stage_needs(root), targets))


def outdated(root: Path, needs: Needs) -> Iterator[tuple[str, str]]:
    """Yield those of the stages that are not up to date, and why, in the order to run them."""
    stale = dict.fromkeys(stale_manifests(root), "its local files changed")
    status = json.loads(ask_dvc(root, "status", "--json"))
    found = stale | {name: _changes(entries) for name, entries in status.items()}
    running: set[str] = set()
    for name in by_urgency(needs):
        cause = min(needs[name] & running, default="")
        why = f"{cause} runs" if cause else found.get(name, "")
        if why:
            running.add(name)
            yield name, why


def stale_manifests(root: Path) -> dict[str, Path]:
    """Return the manifests of local data sets that have changed since, which DVC does not look at.

    Args:
        root: The project; the stages of its group ``acquire`` write such manifests.
    """
    outs = {
        name: root / out["path"]
        for name, entry in read_lock(root).items()
        if group_of(name) == "acquire"
        for out in entry.get("outs", ())
    }
    return {name: out / MANIFEST for name, out in outs.items() if is_stale(out, base=root)}


def alone_groups(root: Path) -> set[str]:
    """Return the groups with ``meta: {alone: true}``: they measure time, so nothing runs beside."""
    groups = read_yaml(root / "dvc.yaml")["stages"]
    bodies = {name: group.get("do", group) for name, group in groups.items()}
    return {name for name, body in bodies.items() if (body.get("meta") or {}).get("alone")}


def _changes(entries: Sequence[Any]) -> str:
    """Say in a few words what DVC found changed."""
    said = ["its command changed"] if "changed command" in entries else []
    changed = [change for entry in entries if isinstance(entry, dict) for change in entry.values()]
    found = [pair for change in changed if isinstance(change, dict) for pair in change.items()]
    for name, how in found[:2]:
        parts = how if isinstance(how, dict) else {name: how}  # params.yaml: {key: modified}
        said += [f"{part} is {state}" for part, state in parts.items()][:2]
    return "; ".join(said) or "DVC always runs it"
