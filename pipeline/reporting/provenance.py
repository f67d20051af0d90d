"""Where a report comes from: the code, the digests of what it read, the versions it ran on."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from pipeline.tracking.restored import read_lock
from pipeline.tracking.run import git

PACKAGES = ("h5py", "matplotlib", "numpy", "open3d", "plotly", "scipy", "torch")
CODE = ("pcrdiff", "pipeline", "stages", "params.yaml", "dvc.yaml")
"""What decides the numbers; a change elsewhere leaves them as they are."""
READ = ("data/pairs/", "results/", "models/")
"""Where the report's inputs lie."""


@dataclass(frozen=True)
class Provenance:
    """What ties a report to code and data."""

    revision: str | None
    """The commit checked out; None outside git."""
    changed: tuple[str, ...]
    """Paths of code and params that differ from that commit."""
    digests: Mapping[str, str]
    """md5 of each input that ``dvc.lock`` names, by path; empty where there is none."""
    python: str
    packages: Mapping[str, str]
    """Versions by name."""


def read_provenance(root: Path) -> Provenance:
    """Ask git, ``dvc.lock`` and the interpreter.

    Raises:
        ValueError: There is a ``dvc.lock``, and it is not one.
    """
    revision = git("rev-parse", "HEAD", folder=root) or None
    changed = git("diff", "--name-only", "--relative", "HEAD", "--", *CODE, folder=root)
    new = git("ls-files", "--others", "--exclude-standard", "--", *CODE, folder=root)
    return Provenance(
        revision=revision,
        changed=tuple(sorted({*changed.splitlines(), *new.splitlines()})) if revision else (),
        digests=_digests(root),
        python=platform.python_version(),
        packages={name: version(name) for name in PACKAGES},
    )


def _digests(root: Path) -> dict[str, str]:
    """The md5 of what stages wrote to where the report reads; the report's own entry is older."""
    return {
        str(out["path"]): str(out["md5"])
        for stage in read_lock(root).values()
        for out in stage.get("outs") or []
        if "md5" in out and str(out["path"]).startswith(READ)
    }
