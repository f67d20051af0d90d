"""The stages and what each needs, as the command ``dvc`` says it."""

import re
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from graphlib import TopologicalSorter
from pathlib import Path

Needs = Mapping[str, set[str]]
"""Each stage with the stages whose outputs it reads."""
REMEDY = "mend it, or bring back the committed one with `git checkout HEAD -- FILE`"


def stage_needs(root: Path) -> dict[str, set[str]]:
    """Return the graph of the project, for which DVC reads its config, dvc.yaml and dvc.lock.

    Raises:
        ValueError: One of these files is damaged, in conflict or of another DVC.
    """
    needs: dict[str, set[str]] = {}
    for line in ask_dvc(root, "dag", "--dot").splitlines():
        names = re.findall('"(.+?)"', line)  # "stage"; or "stage" -> "one that needs it";
        if names:
            needs.setdefault(names[-1], set()).update(names[:-1])
    return needs


def wanted(needs: Needs, targets: Sequence[str]) -> Needs:
    """Return the part of the graph that stages or groups need; without any, all of it.

    Raises:
        ValueError: No stage and no group has such a name.
    """
    stages: set[str] = set()
    for target in targets:
        found = {name for name in needs if target in (name, group_of(name))}
        if not found:
            raise ValueError(f"no stage is called {target!r}")
        stages |= found
    return leading_to(stages, needs) if targets else needs


def leading_to(stages: Iterable[str], needs: Needs) -> Needs:
    """Return the part of the graph that ends with these stages."""
    pending = list(stages)
    found = set(pending)
    for name in pending:  # which grows
        before = needs[name] - found
        found |= before
        pending += before
    return {name: before for name, before in needs.items() if name in found}


def by_urgency(needs: Needs) -> list[str]:
    """Order stages: first those that most others wait for, of equals those that need most.

    So trainings go before evaluations, and the many small evaluations fill the end.
    """
    waiting = {name: {name} for name in needs}
    for name in reversed([*TopologicalSorter(needs).static_order()]):
        for need in needs[name]:
            waiting[need] |= waiting[name]
    return sorted(needs, key=lambda name: (-len(waiting[name]), -len(needs[name])))


def group_of(stage: str) -> str:
    """Return the name in dvc.yaml of what a stage is one of."""
    return stage.partition("@")[0]


def ask_dvc(root: Path, *words: str) -> str:
    """Return what ``dvc`` prints.

    Raises:
        ValueError: It refuses, since one of its files is damaged, say.
    """
    command = [sys.executable, "-m", "dvc", "--wait-for-lock", "--cd", str(root), *words]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode:
        said = re.split("Traceback|Having any troubles", done.stderr)[0]
        said = " ".join(said.split()).removeprefix("ERROR: ")
        if said.startswith("unexpected error - 'utf-8' codec"):  # DVC names every other file
            said = f".dvcignore is not UTF-8 ({said})"
        raise ValueError(f"DVC cannot read {root}: {said}: {REMEDY}")
    return done.stdout
