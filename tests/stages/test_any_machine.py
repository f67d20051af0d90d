"""What a stage writes does not hang on how the machine is set: each of these is a real one."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.described import REPOSITORY
from tests.pipeline.reporting.synthetic_results import make_report_inputs, write_everything
from tests.tiny import CB, CF, SCENARIO, instance, lay_out, run_instance, standing_in

STAGES = [
    "acquire@modelnet40",
    f"preprocess@{SCENARIO}",
    f"train@{SCENARIO}-{CF}",
    f"train@{SCENARIO}-{CB}",
    "train_baselines@pcrnet",
    "train_baselines@rpmnet",
    f"evaluate@{CF}",
    "time",
]
MEASURED = ("seconds", "peak_memory_mib")
RUN = "import sys, tests.tiny as t; [t.run_instance(t.instance(name)) for name in sys.argv[1:]]"
REPORT = """\
import sys, stages.report
from pipeline.tracking.mlflow_sync import SyncReport
stages.report.sync_after_report = lambda: SyncReport("nowhere")
stages.report.main(sys.argv[1:])
"""
ODD = {
    "LC_ALL": "C",  # a locale without UTF-8, which every machine has
    "PYTHONUTF8": "0",
    "PYTHONCOERCECLOCALE": "0",
    "TZ": "Asia/Kolkata",
}
"""Not the processor's instructions: sums in wider registers are rounded in another order."""


def hold() -> None:
    """Private files, and one core."""
    os.umask(0o077)
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def run_oddly(folder: Path, code: str, *words: str) -> None:
    """Run code in a process to which everything about the machine is odd at once."""
    told = {"DVC_ROOT": str(folder), "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=folder,
        env={**os.environ, **told, **ODD},
        preexec_fn=hold,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")


def written(folder: Path) -> dict[str, object]:
    """The bytes that the stages of ``STAGES`` have written below a project, but what they measured."""
    outs = [folder / out for name in STAGES for out in instance(name).outs]
    files = [file for out in outs for file in ([out] if out.is_file() else out.rglob("*"))]
    return {str(file.relative_to(folder)): content(file) for file in files if file.is_file()}


def content(file: Path) -> object:
    if file.parent.name != "times":
        return file.read_bytes()
    rows = csv.DictReader(file.read_text(encoding="utf-8").splitlines())
    return [[value for name, value in row.items() if name not in MEASURED] for row in rows]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project in which the stages of ``STAGES`` have run here and now."""
    folder = tmp_path_factory.mktemp("made") / "project"
    lay_out(folder)
    params = folder / "params.yaml"
    params.write_text(params.read_text(encoding="utf-8") + "# Maße\n", encoding="utf-8")
    with standing_in(folder):
        for name in STAGES:
            run_instance(instance(name))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("place", ["a b/it's", "Maße"])
def test_stages_write_the_same_bytes_on_an_odd_machine_in(
    place: str, made: Path, tmp_path: Path
) -> None:
    odd = tmp_path / place
    shutil.copytree(made, odd, symlinks=True)
    for name in STAGES:
        for out in instance(name).outs:
            shutil.rmtree(odd / out) if (odd / out).is_dir() else (odd / out).unlink()
    run_oddly(odd, RUN, *STAGES)
    assert written(odd) == written(made)


@pytest.mark.slow
def test_the_report_is_the_same_bytes_on_an_odd_machine(
    tmp_path: Path, report_project: Path
) -> None:
    from stages.report import main

    write_everything(tmp_path, ("kitti",), 4)
    main(make_report_inputs(tmp_path))
    reports = tmp_path / "reports"
    before = {file: file.read_bytes() for file in reports.rglob("*") if file.is_file()}
    shutil.rmtree(reports)
    run_oddly(report_project, REPORT, *make_report_inputs(tmp_path))
    after = {file: file.read_bytes() for file in reports.rglob("*") if file.is_file()}
    assert after == before
    assert len(before) > 5
