"""The pipeline on real data: an experiment of its own beside the workspace, its tables brought back."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from dvc.api import DVCFileSystem

from pipeline.command.locks import check_locks
from pipeline.formats.files import write_atomically
from pipeline.formats.yaml_files import read_mapping
from pipeline.settings.params import check_params
from pipeline.settings.profiles import profile_values
from pipeline.tracking.run import SHELL, ask_git, check_experiments

NAME = "real"
VARIABLE = "PCRDIFF_REAL_DATA"
DEFAULT = "../shared/data"
"""Relative to the project; the roots in profiles/real.yaml begin with it."""
FETCHED = Path("reports", NAME)


def plan_real(root: Path) -> Iterator[str]:
    """Say, line by line, what ``run_real`` will train, what that costs, and where it leaves what.

    Raises:
        FileNotFoundError, ValueError: As ``run_real``, or a data set is not what it should be.
    """
    from pipeline.command.estimate import estimate, told

    params = check_params(_wanted(root), root / "profiles" / f"{NAME}.yaml")
    threads = "one thread" if params.threads == 1 else f"{params.threads} threads"
    yield f"Estimate, on this machine, {threads} a training, from a few steps on random clouds:"
    yield from told(estimate(params, root))
    yield "What DVC's cache or a checkpoint holds costs nothing again. Making pairs, evaluating and"
    yield "ablating come on top. DVC runs one stage after the other, in a folder of its own below"
    yield f".dvc/tmp/exps; it keeps what it makes in its cache, as the experiment {NAME!r}. Checkpoints"
    yield f"lie in .pcrdiff/checkpoints; the report comes to {FETCHED}."


def run_real(root: Path) -> list[Path]:
    """Run the profile ``real`` as the experiment ``real`` and fetch its tables, figures and page.

    The workspace keeps its params.yaml, dvc.lock and data: DVC is given the values that differ, runs
    the experiment in a folder of its own, and what it computed stays in the cache. Run again after it
    was cut off, it takes finished stages from there and goes on with trainings at their checkpoints.

    Returns:
        The files that were brought back.

    Raises:
        FileNotFoundError: There is no real data.
        ValueError: Git could not keep the experiment, somebody else works in the project, the data's
            path cannot be written into YAML, the profile or params.yaml is not valid, or a stage
            failed; that one's own sentence stands above.
    """
    wanted = _wanted(root)
    changes = overrides(read_mapping(root / "params.yaml"), wanted)
    _dvc(root, "exp", "remove", "--quiet", NAME, check=False)
    _dvc(root, "exp", "run", "--temp", "--name", NAME, *changes)
    return _fetch(root)


def _wanted(root: Path) -> dict[str, Any]:
    """Check that the experiment can be run, and return the values of its params.yaml."""
    check_experiments(root)
    check_locks(root)
    return _values_on(_folder(root), profile_values(root, NAME))


def _folder(root: Path) -> str:
    named = os.environ.get(VARIABLE)
    if not Path(root, named or DEFAULT).is_dir():
        where = f"{VARIABLE}={named}" if named else f"{VARIABLE} or {DEFAULT}"
        raise FileNotFoundError(f"real data is needed at {where}, there is no such folder")
    if not (named or DEFAULT).isprintable():  # YAML has no such characters, or not on one line
        raise ValueError(f"{VARIABLE} needs the path in printable characters, got {named!a}")
    return named or DEFAULT


def _values_on(folder: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the values of the profile with its roots below another folder."""
    for acquire in values["acquire"].values():
        if (acquire["root"] or "").startswith(DEFAULT):
            acquire["root"] = folder + acquire["root"].removeprefix(DEFAULT)
    return values


def overrides(present: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    """Return the options of ``dvc exp run`` that make the values of params.yaml others.

    Args:
        present: What params.yaml holds.
        wanted: What it shall hold. A section that differs is given as a whole, because the paths of
            ``--set-param`` name nothing that begins with a digit.
    """
    gone = [f"~{key}" for key in present if present[key] != wanted.get(key)]
    new = [f"+{key}={_hydra(value)}" for key, value in wanted.items() if present.get(key) != value]
    return [word for change in (*gone, *new) for word in ("--set-param", change)]


def _hydra(value: object) -> str:
    """Return a value in the grammar of ``--set-param``, which is Hydra's."""
    match value:
        case dict():
            return "{" + ",".join(f"{key}:{_hydra(each)}" for key, each in value.items()) + "}"
        case list():
            return "[" + ",".join(map(_hydra, value)) + "]"
        case str():
            literal = re.sub(r"(\\*)\$\{", r"\1\1\\${", value)  # else it names another value
            return '"' + re.sub(r'(\\*)("|$)', _escaped, literal) + '"'
        case None:
            return "null"
    return repr(value)


def _escaped(found: re.Match[str]) -> str:
    """Double the backslashes before a quotation mark or the end, and put one before the mark."""
    return found[1] * 2 + ("\\" + found[2] if found[2] else "")


def _fetch(root: Path) -> list[Path]:
    """Take the experiment's tables, figures and page out of DVC's cache."""
    refs = ask_git("for-each-ref", "--format=%(refname)", "refs/exps", folder=root).split()
    ref = next((ref for ref in refs if ref.endswith(f"/{NAME}")), None)
    if ref is None:
        raise ValueError(f"DVC kept no experiment {NAME!r}; `dvc exp show` lists those there are")
    files = DVCFileSystem(str(root), rev=ref)
    names = [name for folder in ("tables", "figures") for name in files.find(f"reports/{folder}")]
    found = {_place(name): files.cat_file(name) for name in [*names, "reports/index.html"]}
    shutil.rmtree(root / FETCHED / "figures", ignore_errors=True)
    for place, content in found.items():
        write_atomically(root / place, content)
    return [*found]


def _place(name: str) -> Path:
    inside = Path(name.lstrip("/")).relative_to("reports")
    return FETCHED / (inside.name if inside.parts[0] == "tables" else inside)


def _dvc(root: Path, *words: str, check: bool = True) -> None:
    quiet = None if check else subprocess.DEVNULL
    command = [sys.executable, "-m", "dvc", *words]
    where = {**os.environ, "SHELL": SHELL}
    code = subprocess.run(command, cwd=root, env=where, stderr=quiet, check=False).returncode
    if check and code:
        raise ValueError(f"`dvc {' '.join(words[:2])}` failed with exit code {code}, see above")
