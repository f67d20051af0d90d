"""What `dvc repro` would run. DVC's own ``--dry`` stops at the first input that is yet to be made."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any


def plan_stages(root: Path, targets: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield ``(stage, why)`` in the order in which they would run.

    Args:
        root: The project.
        targets: Stages, or groups such as ``train``, with all they need; none means all.

    Raises:
        ValueError: No such stage, or no DVC project.
    """
    import networkx as nx
    from dvc.exceptions import DvcException
    from dvc.repo import Repo

    try:
        repo = Repo(str(root))
    except DvcException as error:
        raise ValueError(str(error)) from error
    graph = repo.index.graph  # from a stage to those it needs
    if targets:
        wanted = [stage for name in targets for stage in _named(graph.nodes, name)]
        needed = {stage for name in wanted for stage in (name, *nx.descendants(graph, name))}
        graph = graph.subgraph(needed)
    running: set[object] = set()
    with repo.lock:
        for stage in nx.dfs_postorder_nodes(graph):
            above = [_name(needed) for needed in graph.successors(stage) if needed in running]
            why = f"{above[0]} runs" if above else _changes(stage.status())
            if why:
                running.add(stage)
                yield _name(stage), why


def _named(stages: Iterable[Any], name: str) -> list[Any]:
    found = [stage for stage in stages if _name(stage).partition("@")[0] == name]
    found += [stage for stage in stages if _name(stage) == name and "@" in name]
    if not found:
        raise ValueError(f"no stage is called {name!r}")
    return found


def _name(stage: Any) -> str:  # noqa: ANN401  DVC's own stage
    return str(getattr(stage, "name", None) or stage.relpath)


def _changes(status: "dict[str, list[object]]") -> str:
    """Say in a few words what DVC found changed; nothing where nothing is."""
    found = [
        f"{name} is {how}"
        for entries in status.values()
        for entry in entries
        if isinstance(entry, dict)
        for changed in entry.values()
        for name, how in (changed.items() if isinstance(changed, dict) else [])
    ]
    commands = any(entry == "changed command" for e in status.values() for entry in e)
    return "; ".join([*(["its command changed"] if commands else []), *found[:2]])
