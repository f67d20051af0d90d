"""What a stage writes does not hang on how the machine is set: each of these is a real one."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.described import REPOSITORY
from tests.tiny import CF, SCENARIO, instance

STAGES = [f"preprocess@{SCENARIO}", f"train@{SCENARIO}-{CF}", f"evaluate@{SCENARIO}-{CF}"]
RUN = "import sys, tests.tiny as t; [t.run_instance(t.instance(name)) for name in sys.argv[1:]]"
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
"""A locale without UTF-8, which every machine has."""
SETTINGS: dict[str, dict[str, str]] = {
    "text is ascii": ASCII,
    "the time zone is odd": {"TZ": "Asia/Kolkata"},
    "instructions are AVX2": {"ONEDNN_MAX_CPU_ISA": "AVX2", "ATEN_CPU_CAPABILITY": "avx2"},
}
HELD: dict[str, Callable[[], object]] = {
    "files are private": lambda: os.umask(0o077),
    "there is one core": lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}),
}


def written(folder: Path) -> dict[str, bytes]:
    """The bytes that the stages of ``STAGES`` have written below a project."""
    outs = [out for name in STAGES for out in instance(name).outs]
    return {out: (folder / out).read_bytes() for out in outs}


def run_again(
    folder: Path, setting: dict[str, str], hold: Callable[[], object] | None = None
) -> None:
    """Run the stages anew in a process of its own."""
    for name in STAGES:
        for out in instance(name).outs:
            (folder / out).unlink()
    told = {"DVC_ROOT": str(folder), "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", RUN, *STAGES],
        cwd=folder,
        env={**os.environ, **told, **setting},
        preexec_fn=hold,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SETTINGS, *HELD])
def test_stages_write_the_same_bytes_where(name: str, project: Path) -> None:
    params = project / "params.yaml"
    params.write_text(params.read_text(encoding="utf-8") + "# Maße\n", encoding="utf-8")
    before = written(project)
    run_again(project, SETTINGS.get(name, {}), HELD.get(name))
    assert written(project) == before


@pytest.mark.slow
def test_stages_write_the_same_bytes_in_a_folder_with_a_blank(
    project: Path, tmp_path: Path
) -> None:
    before = written(project)
    odd = tmp_path / "a b" / "Maße"
    shutil.copytree(project, odd, symlinks=True)
    run_again(odd, {})
    assert written(odd) == before
