"""What `dvc repro` would run. DVC's own ``--dry`` stops at the first input that is yet to be made."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcrdiff.data.acquisition import MANIFEST, is_stale
from pipeline.locks import check_locks


def plan_stages(root: Path, targets: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield ``(stage, why)`` in the order in which they would run.

    Args:
        root: The project.
        targets: Stages, or groups such as ``train``, with all they need; none means all.

    Raises:
        ValueError: No such stage, no DVC project, or somebody else works in it.
    """
    from dvc.exceptions import DvcException

    check_locks(root)
    try:
        yield from _plan(root, targets)
    except DvcException as error:
        raise ValueError(str(error)) from error


def open_repo(root: Path, *, wait: bool = False) -> Any:  # noqa: ANN401  DVC's own
    """Open the project with DVC, which reads its config, ``dvc.yaml`` and ``dvc.lock`` for that.

    Args:
        root: The project.
        wait: Whether DVC later waits for a lock that another holds.

    Raises:
        ValueError: One of these files is damaged, in conflict or of another DVC.
    """
    from dvc.config import ConfigError
    from dvc.repo import Repo
    from dvc.utils.serialize import ParseError
    from dvc.utils.strictyaml import YAMLValidationError

    try:
        repo = Repo(str(root), _wait_for_lock=wait)
        _ = repo.index.graph
    except (ConfigError, ParseError, YAMLValidationError, UnicodeDecodeError) as error:
        cause = " ".join(str(error.__cause__ or "").split())
        why = f"{error} ({cause})" if cause else str(error)
        if isinstance(error, UnicodeDecodeError):  # the others have been named by DVC
            why = f".dvcignore is not UTF-8 ({error})"
        remedy = "mend it, or bring back the committed one with `git checkout HEAD -- FILE`"
        raise ValueError(f"DVC cannot read {root}: {why}: {remedy}") from error
    return repo


def _plan(root: Path, targets: Sequence[str]) -> Iterator[tuple[str, str]]:
    import networkx as nx

    repo = open_repo(root)
    graph = repo.index.graph  # from a stage to those it needs
    if targets:
        wanted = [stage for name in targets for stage in named(graph.nodes, name)]
        above = {needed for stage in wanted for needed in nx.descendants(graph, stage)}
        graph = graph.subgraph({*wanted, *above})
    running: set[object] = set()
    with repo.lock:
        for stage in nx.dfs_postorder_nodes(graph):
            causes = [stage_name(needed) for needed in graph.successors(stage) if needed in running]
            why = f"{causes[0]} runs" if causes else _changes(stage.status())
            why = why or ("its local files changed" if stale_manifests(root, [stage]) else "")
            if why:
                running.add(stage)
                yield stage_name(stage), why


def named(stages: Iterable[Any], name: str) -> list[Any]:
    """The stages of DVC's that a name or the name of a group stands for.

    Raises:
        ValueError: There is none.
    """
    found = [s for s in stages if name in (stage_name(s), stage_name(s).partition("@")[0])]
    if not found:
        raise ValueError(f"no stage is called {name!r}")
    return found


def stale_manifests(root: Path, stages: Iterable[Any]) -> list[Path]:
    """The manifests of local data sets that have changed since, which DVC does not look at.

    Args:
        root: The project.
        stages: DVC's; those of the group ``acquire`` have such manifests.
    """
    acquired = (s for s in stages if stage_name(s).partition("@")[0] == "acquire")
    folders = [Path(out.fs_path) for stage in acquired for out in stage.outs]
    return [folder / MANIFEST for folder in folders if is_stale(folder, base=root)]


def stage_name(stage: Any) -> str:  # noqa: ANN401  DVC's own stage
    """What a stage is called in dvc.yaml and dvc.lock."""
    return str(getattr(stage, "name", None) or stage.relpath)


def _changes(status: Mapping[str, Sequence[Any]]) -> str:
    """Say in a few words what DVC found changed; nothing where nothing is."""
    entries = [entry for found in status.values() for entry in found]
    said = ["its command changed"] if "changed command" in entries else []
    changed = [change for entry in entries if isinstance(entry, dict) for change in entry.values()]
    found = [pair for change in changed if isinstance(change, dict) for pair in change.items()]
    for name, how in found[:2]:
        parts = how if isinstance(how, dict) else {name: how}  # params.yaml: {key: modified}
        said += [f"{part} is {state}" for part, state in parts.items()][:2]
    return "; ".join(said)
