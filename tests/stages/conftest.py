"""The tiny project, for the tests of the stages."""

import shutil
from pathlib import Path

import pytest

from pipeline.tracking.mlflow_sync import SyncReport
from tests.tiny import blank as blank
from tests.tiny import project as project


@pytest.fixture
def report_project(tmp_path: Path, repository: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a params.yaml, as the current one, in which the report asks no MLflow."""
    folder = tmp_path / "project"
    folder.mkdir()
    shutil.copy(repository / "params.yaml", folder)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("DVC_ROOT", str(folder))
    monkeypatch.setattr("stages.report.sync_after_report", lambda: SyncReport("nowhere"))
    return folder
