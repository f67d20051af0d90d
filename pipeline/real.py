"""The pipeline on real data: an experiment of its own beside the workspace, its tables brought back."""

import os
import subprocess
import sys
from io import BytesIO
from pathlib import Path

from ruamel.yaml import YAML

from pipeline.artifacts import write_atomically
from pipeline.invocation import SHELL, check_experiments
from pipeline.locks import check_locks

NAME = "real"
VARIABLE = "PCRDIFF_REAL_DATA"
DEFAULT = "../shared/data"
"""Relative to the project; the roots in profiles/real.yaml begin with it."""


def run_real(root: Path) -> list[Path]:
    """Run profiles/real.yaml as the experiment ``real`` and fetch its tables, figures and page.

    The workspace keeps its params.yaml, dvc.lock and data: DVC runs the experiment in a folder of
    its own, and what it computed stays in the cache.

    Returns:
        The files that were brought back.

    Raises:
        FileNotFoundError: There is no real data.
        ValueError: Git could not keep the experiment, somebody else works in the project, the data's
            path cannot be written into YAML, or a stage failed; that one's own sentence stands above.
    """
    check_experiments(root)
    check_locks(root)
    profile = _profile_on(_folder(root), root / "profiles" / f"{NAME}.yaml")
    params = root / "params.yaml"
    before = params.read_bytes()
    _dvc(root, "exp", "remove", "--quiet", NAME, check=False)
    try:
        write_atomically(params, profile)
        _dvc(root, "exp", "run", "--temp", "--name", NAME)
    finally:
        write_atomically(params, before)
    return _fetch(root)


def _folder(root: Path) -> str:
    told = os.environ.get(VARIABLE)
    if not Path(root, told or DEFAULT).is_dir():
        where = f"{VARIABLE}={told}" if told else f"{VARIABLE} or {DEFAULT}"
        raise FileNotFoundError(f"real data is needed at {where}, there is no such folder")
    if not (told or DEFAULT).isprintable():  # YAML has no such characters, or not on one line
        raise ValueError(f"{VARIABLE} needs the path in printable characters, got {told!a}")
    return told or DEFAULT


def _profile_on(folder: str, path: Path) -> bytes:
    """Return the profile with its roots below another folder, comments included."""
    yaml = YAML()
    params = yaml.load(path.read_text(encoding="utf-8"))
    for acquire in params["acquire"].values():
        if (acquire["root"] or "").startswith(DEFAULT):
            acquire["root"] = folder + acquire["root"].removeprefix(DEFAULT)
    written = BytesIO()
    yaml.dump(params, written)
    return written.getvalue()


def _fetch(root: Path) -> list[Path]:
    """Take the small files out of the experiment's commit, and the page out of the cache."""
    refs = _git(root, "for-each-ref", "--format=%(refname)", "refs/exps").decode().split()
    commit = next((ref for ref in refs if ref.endswith(f"/{NAME}")), None)
    if commit is None:
        raise ValueError(f"DVC kept no experiment {NAME!r}; `dvc exp show` lists those there are")
    names = _git(root, "ls-tree", "-r", "--name-only", commit, "reports").decode().split()
    wanted = [name for name in names if Path(name).stem == NAME or f"/{NAME}/" in name]
    for name in wanted:
        write_atomically(root / name, _git(root, "show", f"{commit}:./{name}"))
    page = Path("reports", f"{NAME}.html")
    revision = _git(root, "rev-parse", commit).decode().strip()
    _dvc(root, "get", "-q", "-f", ".", "reports/index.html", "--rev", revision, "-o", str(page))
    return [*map(Path, wanted), page]


def _dvc(root: Path, *words: str, check: bool = True) -> None:
    quiet = None if check else subprocess.DEVNULL
    command = [sys.executable, "-m", "dvc", *words]
    where = {**os.environ, "SHELL": SHELL}
    code = subprocess.run(command, cwd=root, env=where, stderr=quiet, check=False).returncode
    if check and code:
        raise ValueError(f"`dvc {' '.join(words[:2])}` failed with exit code {code}, see above")


def _git(root: Path, *words: str) -> bytes:
    done = subprocess.run(["git", *words], cwd=root, check=False, stdout=subprocess.PIPE)
    if done.returncode:
        raise ValueError(f"`git {words[0]}` failed with exit code {done.returncode}, see above")
    return done.stdout
