"""What ``pcrdiff doctor`` looks at: each check is a function from the project to findings."""

import re
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

from pipeline.housekeeping import dead_experiments
from pipeline.invocation import git

Level = Literal["ok", "warning", "error"]
LEAST_FREE_GB = 2.0


@dataclass(frozen=True)
class Finding:
    """One sentence about one thing; an error stops the pipeline, a warning may mislead."""

    level: Level
    sentence: str


Check = Callable[[Path], Iterator[Finding]]


def examine(root: Path) -> Iterator[Finding]:
    """Run every check; one that breaks is a finding too, and the others still run."""
    for check in CHECKS:
        try:
            yield from check(root)
        except Exception as error:  # noqa: BLE001  a doctor reports, whatever the illness
            what = check.__name__.removeprefix("check_").replace("_", " ")
            yield Finding("error", f"{what}: {' '.join(str(error).split())}")


def check_packages(_root: Path) -> Iterator[Finding]:
    """Python, and the packages this one requires, at versions it allows."""
    from packaging.requirements import Requirement

    yield Finding("ok", f"Python {sys.version.split()[0]}")
    missing = 0
    for text in metadata.requires("pcrdiff") or []:
        need = Requirement(text)
        if need.marker and not need.marker.evaluate({"extra": ""}):
            continue
        have = _version(need.name)
        if not need.specifier.contains(have or "0", prereleases=True) or not have:
            missing += 1
            yield Finding("error", f"{need.name} is {have or 'missing'}, needed is {need}")
    if not missing:
        yield Finding("ok", "all required packages are there")


def check_lock(root: Path) -> Iterator[Finding]:
    """The installed versions against each ``requirements/*.txt`` that pins them."""
    for path in sorted((root / "requirements").glob("*.txt")):
        pinned = re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;\\]+)", path.read_text(), re.MULTILINE)
        have = {name: _version(name) for name, _ in pinned}
        other = [f"{n} {have[n]} (locked {v})" for n, v in pinned if have[n] not in (None, v)]
        if other:
            named = f"{', '.join(other[:5])}{', ...' if len(other) > 5 else ''}"
            sentence = f"{len(other)} of {len(pinned)} packages are not as in {path.name}: {named}"
            yield Finding("warning", sentence)
        else:
            yield Finding("ok", f"the packages are as in {path.name}")


def check_open3d(_root: Path) -> Iterator[Finding]:
    """Open3D can be imported: it needs libusb and a glibc of 2.35."""
    try:
        from pcrdiff.data.native import open3d
    except (ImportError, OSError) as error:
        yield Finding("error", f"open3d cannot be imported: {error}")
        return
    yield Finding("ok", f"open3d {open3d.__version__}")


def check_params(root: Path) -> Iterator[Finding]:
    """params.yaml is what the stages will accept."""
    from pipeline.params import read_params

    read_params(root / "params.yaml")
    yield Finding("ok", "params.yaml is valid")


def check_code_in_git(root: Path) -> Iterator[Finding]:
    """No code that ``dvc exp run`` would run with and yet not commit."""
    new = git("ls-files", "--others", "--exclude-standard", "--", "*.py", folder=root).split("\n")
    if not git("rev-parse", "HEAD", folder=root):
        yield Finding("error", f"{root} is not a git repository with a commit; dvc exp needs one")
    elif new != [""]:
        named = ", ".join(new[:5]) + (", ..." if len(new) > 5 else "")
        advice = "`dvc exp run` would not commit them; git add them"
        yield Finding("warning", f"{len(new)} Python files are not in git: {named}; {advice}")
    else:
        yield Finding("ok", "all Python files are in git")


def check_dead_experiments(root: Path) -> Iterator[Finding]:
    """No folders of killed experiments."""
    dead = list(dead_experiments(root))
    if dead:
        sentence = f"{len(dead)} folders of killed experiments; `pcrdiff clean` removes them"
        yield Finding("warning", sentence)
    else:
        yield Finding("ok", "no folders of killed experiments")


def check_mlflow(root: Path) -> Iterator[Finding]:
    """The store answers, and keeps artifacts where this project would look for them."""
    from pipeline.mlflow_store import artifacts_folder, public, tracking_uri
    from pipeline.mlflow_sync import open_store
    from pipeline.records import waiting_records

    uri = tracking_uri(root)
    client, experiment = open_store(root)
    yield Finding("ok", f"MLflow answers at {public(uri)}")
    kept, expected = (
        client.get_experiment(experiment).artifact_location,
        artifacts_folder(uri, root),
    )
    if expected and kept != expected:
        yield Finding("warning", f"MLflow keeps artifacts in {kept}, not in {expected}")
    waiting = len(waiting_records(root))
    if waiting:
        yield Finding("warning", f"{waiting} journals wait; `pcrdiff mlflow sync` sends them")


def check_disk(root: Path) -> Iterator[Finding]:
    """Room for data, models and DVC's cache."""
    free = shutil.disk_usage(root).free / 1e9
    level: Level = "ok" if free >= LEAST_FREE_GB else "warning"
    yield Finding(level, f"{free:.1f} GB free on the disk of {root}")


def check_weights(root: Path) -> Iterator[Finding]:
    """Every weights file opens."""
    from safetensors import SafetensorError, safe_open

    paths = sorted((root / "models").rglob("*.safetensors"))
    bad = 0
    for path in paths:
        try:
            with safe_open(path, framework="numpy"):
                continue
        except (SafetensorError, OSError) as error:
            bad += 1
            yield Finding("error", f"{path.relative_to(root)} cannot be read: {error}")
    if not bad:
        yield Finding("ok", f"{len(paths)} weights files are readable")


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


CHECKS: tuple[Check, ...] = (
    check_packages,
    check_lock,
    check_open3d,
    check_params,
    check_code_in_git,
    check_dead_experiments,
    check_mlflow,
    check_disk,
    check_weights,
)
