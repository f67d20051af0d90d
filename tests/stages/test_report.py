"""The report stage, end to end on made-up results."""

import json
import shutil
from pathlib import Path

import pytest

from pipeline.mlflow_sync import SyncReport
from pipeline.reporting.tables import parse_rows
from stages.report import main
from tests.pipeline.reporting.made_up_results import make_report_inputs, write_everything

SCENARIOS = ("modelnet40-unseen_objects", "kitti")
PICTURES = ["ablations", "accuracy_time", "curves", "difficulty", "distributions", "errors"]
PICTURES += ["overlays", "panels_kitti", "panels_modelnet40", "steps"]
FILES = [
    *(f"figures/{name}.png" for name in PICTURES),
    "index.html",
    "results.csv",
    "results.md",
    "results.tex",
    "summary.json",
]


@pytest.fixture(autouse=True)
def in_a_project(tmp_path: Path, repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The stage runs where a params.yaml is, and MLflow is not asked."""
    project = tmp_path / "project"
    project.mkdir()
    shutil.copy(repository / "params.yaml", project)
    monkeypatch.chdir(project)
    monkeypatch.setenv("DVC_ROOT", str(project))
    monkeypatch.setattr("stages.report.sync_after_report", lambda: SyncReport("nowhere"))


def contents(folder: Path) -> dict[str, bytes]:
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_writes_every_output_and_the_same_bytes_twice(tmp_path: Path) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    once = contents(tmp_path / "reports")
    main(make_report_inputs(tmp_path))
    assert sorted(once) == FILES  # and no temporary file is left
    assert contents(tmp_path / "reports") == once


def test_the_summary_holds_numbers_of_the_table(tmp_path: Path) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    summary = json.loads((tmp_path / "reports" / "summary.json").read_text())
    rows = parse_rows((tmp_path / "reports" / "results.csv").read_text())
    (cb,) = [
        row.value
        for row in rows
        if (row.scenario, row.method, row.metric) == ("kitti", "pcrdiffusion_cb", "error_r_deg")
        and row.kind == "line"
    ]
    assert summary["error_r_deg"]["kitti"]["pcrdiffusion_cb"] == cb
    assert len(summary["error_r_deg"]["modelnet40-unseen_objects"]) == 7
    assert summary["profile"] == "quick"


def test_a_cut_result_leaves_the_last_report_as_it_was(tmp_path: Path) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    before = contents(tmp_path / "reports")
    file = tmp_path / "results" / "kitti" / "icp.csv"
    file.write_bytes(file.read_bytes()[:-30])
    with pytest.raises(ValueError, match=r"kitti/icp\.csv needs"):
        main(make_report_inputs(tmp_path))
    assert contents(tmp_path / "reports") == before


def test_an_empty_folder_of_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="results needs a <scenario>/<method>"):
        main(make_report_inputs(tmp_path))
