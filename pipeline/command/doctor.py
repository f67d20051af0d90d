"""What ``pcrdiff doctor`` looks at: each check is a function from the project to findings."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from subprocess import DEVNULL
from typing import TYPE_CHECKING, Literal

from pipeline.command.clean import dead_experiments
from pipeline.command.locks import check_locks
from pipeline.tracking.run import SHELL, ask_git, check_experiments

if TYPE_CHECKING:
    from packaging.requirements import Requirement

Level = Literal["ok", "warning", "error"]
LEAST_FREE_GB = 2.0
PROBE = 'env "PATH=$DVC_ROOT/.venv/bin:$PATH" printenv PATH'
"""Begins as every command of dvc.yaml does."""


@dataclass(frozen=True)
class Diagnosis:
    """One sentence about one thing; an error stops the pipeline, a warning may mislead."""

    level: Level
    sentence: str


Check = Callable[[Path], Iterator[Diagnosis]]


def examine(root: Path) -> Iterator[Diagnosis]:
    """Run every check; one that breaks is a finding too, and the others still run."""
    for check in CHECKS:
        try:
            yield from check(root)
        except Exception as error:  # noqa: BLE001  a doctor reports, whatever the illness
            what = check.__name__.removeprefix("check_").replace("_", " ")
            yield Diagnosis("error", f"{what}: {' '.join(str(error).split())}")


def check_packages(_root: Path) -> Iterator[Diagnosis]:
    """Python, and the packages this one requires, at versions it allows."""
    from packaging.requirements import Requirement

    yield Diagnosis("ok", f"Python {sys.version.split()[0]}")
    needs = [Requirement(text) for text in metadata.requires("pcrdiff") or []]
    faults = [
        Diagnosis("error", f"{need.name} is {have or 'missing'}, needed is {need}")
        for need in needs
        if not need.marker or need.marker.evaluate({"extra": ""})
        if not (have := _version(need.name)) or not need.specifier.contains(have, prereleases=True)
    ]
    yield from faults or [Diagnosis("ok", "all required packages are there")]


def check_lock(root: Path) -> Iterator[Diagnosis]:
    """The installed versions against each ``requirements/*.txt`` that pins them."""
    for path in sorted((root / "requirements").glob("*.txt")):
        pinned = list(_pinned(path))
        other = [
            f"{pin.name} {version} (locked {str(pin.specifier).removeprefix('==')})"
            for pin in pinned
            if (version := _version(pin.name))
            and not pin.specifier.contains(version, prereleases=True)
        ]
        are = f"{len(other)} of {len(pinned)} packages are not as in {path.name}: {_some(other)}"
        yield _warning_if(other, are, f"the packages are as in {path.name}")


def check_open3d(_root: Path) -> Iterator[Diagnosis]:
    """Open3D can be imported: it needs libusb and a glibc of 2.35."""
    try:
        from pcrdiff.bindings.open3d import open3d
    except (ImportError, OSError) as error:
        yield Diagnosis("error", f"open3d cannot be imported: {error}")
        return
    yield Diagnosis("ok", f"open3d {open3d.__version__}")


def check_params_file(root: Path) -> Iterator[Diagnosis]:
    """params.yaml is what the stages will accept."""
    from pipeline.settings.params import read_params

    read_params(root / "params.yaml")
    yield Diagnosis("ok", "params.yaml is valid")


def check_code_in_git(root: Path) -> Iterator[Diagnosis]:
    """Git can keep experiments, and no code that one would run with is left out of its commit."""
    try:
        check_experiments(root)
    except ValueError as error:
        yield Diagnosis("error", str(error))
        return
    listed = ask_git("ls-files", "--others", "--exclude-standard", "--", "*.py", folder=root)
    new = listed.splitlines()
    advice = "`dvc exp run` would not commit them; git add them"
    are = f"{len(new)} Python files are not in git: {_some(new)}; {advice}"
    yield _warning_if(new, are, "all Python files are in git")


def check_shell(root: Path) -> Iterator[Diagnosis]:
    """Plain ``dvc`` runs commands with ``$SHELL``, which has to understand dvc.yaml's."""
    shell = os.environ.get("SHELL") or SHELL
    where = {**os.environ, "DVC_ROOT": str(root)}
    words = [shell, "-c", PROBE]
    try:
        done = subprocess.run(
            words, env=where, stdin=DEVNULL, capture_output=True, text=True, timeout=10, check=False
        )
        said, printed = done.stderr or done.stdout, done.stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        said, printed = str(error), ""
    if printed.rstrip("\n").endswith(f"{root}/.venv/bin:{where.get('PATH', '')}"):
        yield Diagnosis("ok", f"{shell} understands the commands of dvc.yaml")
        return
    cannot = f"`dvc` runs commands with $SHELL, and {shell} cannot run those of dvc.yaml"
    remedy = f"`export SHELL={SHELL}`, or take `pcrdiff repro`"
    yield Diagnosis("error", f"{cannot} ({' '.join(said.split())}): {remedy}")


def check_others(root: Path) -> Iterator[Diagnosis]:
    """Nobody else works in the project, and nobody left a lock behind."""
    check_locks(root)
    yield Diagnosis("ok", "no other DVC works here")


def check_dvc_files(root: Path) -> Iterator[Diagnosis]:
    """DVC can read its config, dvc.yaml and dvc.lock."""
    from pipeline.command.graph import stage_needs

    stage_needs(root)
    yield Diagnosis("ok", "DVC can read its config, dvc.yaml and dvc.lock")


def check_dead_experiments(root: Path) -> Iterator[Diagnosis]:
    """No folders of killed experiments."""
    dead = list(dead_experiments(root))
    are = f"{len(dead)} folders of killed experiments; `pcrdiff clean` removes them"
    yield _warning_if(dead, are, "no folders of killed experiments")


def check_mlflow(root: Path) -> Iterator[Diagnosis]:
    """The store answers, and keeps artifacts where this project would look for them."""
    from pipeline.tracking.mlflow_store import artifacts_folder, public, tracking_uri
    from pipeline.tracking.mlflow_sync import open_store
    from pipeline.tracking.records import waiting_records

    uri = tracking_uri(root)
    client, experiment = open_store(root)
    yield Diagnosis("ok", f"MLflow answers at {public(uri)}")
    kept = client.get_experiment(experiment).artifact_location
    expected = artifacts_folder(uri, root)
    if expected and kept != expected:
        yield Diagnosis("warning", f"MLflow keeps artifacts in {kept}, not in {expected}")
    waiting = len(waiting_records(root))
    if waiting:
        yield Diagnosis("warning", f"{waiting} journals wait; `pcrdiff mlflow sync` sends them")


def check_disk(root: Path) -> Iterator[Diagnosis]:
    """Room for data, models and DVC's cache."""
    free = shutil.disk_usage(root).free / 1e9
    level: Level = "ok" if free >= LEAST_FREE_GB else "warning"
    yield Diagnosis(level, f"{free:.1f} GB free on the disk of {root}")


def check_weights(root: Path) -> Iterator[Diagnosis]:
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
            yield Diagnosis("error", f"{path.relative_to(root)} cannot be read: {error}")
    if not bad:
        yield Diagnosis("ok", f"{len(paths)} weights files are readable")


def _warning_if(found: Sequence[object], sentence: str, fine: str) -> Diagnosis:
    return Diagnosis("warning", sentence) if found else Diagnosis("ok", fine)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")


def _pinned(path: Path) -> Iterator["Requirement"]:
    """Yield the pins that are meant for this Python on this machine."""
    from packaging.requirements import Requirement

    for line in path.read_text().replace("\\\n", " ").splitlines():
        text = re.split(r"\s#|\s--hash", line)[0].strip()
        if text and not text.startswith(("#", "-")):
            pin = Requirement(text)
            if pin.marker is None or pin.marker.evaluate():
                yield pin


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


CHECKS: tuple[Check, ...] = (
    check_packages,
    check_lock,
    check_open3d,
    check_params_file,
    check_code_in_git,
    check_shell,
    check_others,
    check_dvc_files,
    check_dead_experiments,
    check_mlflow,
    check_disk,
    check_weights,
)
