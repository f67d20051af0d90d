"""MLflow's pages as a browser shows them: each stage's run, with its numbers."""

import os
import re
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from pipeline.tracking.journal import journal
from pipeline.tracking.mlflow_runs import Store, runs_page
from pipeline.tracking.mlflow_sync import open_store, sync
from pipeline.tracking.run import VARIABLE
from tests.pipeline.browser import browser as browser

pytestmark = pytest.mark.slow
REPOSITORY = Path(__file__).parents[3]
STAGES = {  # stage: a metric of its own, and the value it ends at
    "train@kitti-cb": ("val_error_r_deg", 1.375),
    "evaluate_classical@icp": ("icp", 2.625),
    "report": ("cb.kitti", 3.125),
}
PATIENCE = 60_000
"""Milliseconds to wait for MLflow's pages: they are large, and the machine may be busy."""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A project of three stage runs, each sent to MLflow by way of its journal."""
    root = tmp_path_factory.mktemp("project")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("DVC_EXP_NAME", "DVC_EXP_BASELINE_REV", "MLFLOW_TRACKING_URI"):
            patch.delenv(name, raising=False)
        patch.setenv("DVC_ROOT", str(root))
        patch.setenv(VARIABLE, "boot-1-1")
        patch.chdir(root)
        for stage, (metric, value) in STAGES.items():
            patch.setenv("DVC_STAGE", stage)
            with journal(params={"seed": 7}) as notes:
                for step in range(3):
                    notes.metrics({metric: value + 2 - step}, step)
        assert sync(root).shipped == len(STAGES)
        yield root


@pytest.fixture(scope="module")
def server(project: Path) -> Iterator[str]:
    """``pcrdiff mlflow ui`` on a free port of this machine, ended by its own id."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    code = "from pipeline.command.cli import app; app()"
    command = [sys.executable, "-c", code, "mlflow", "ui", "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "MLFLOW_DISABLE_TELEMETRY": "true"}
    with (project / "server.log").open("w") as log:
        process = subprocess.Popen(
            command, cwd=project, env=environment, stdout=log, stderr=log, start_new_session=True
        )
        try:
            _wait(address, process, project / "server.log")
            yield address
        finally:
            os.killpg(process.pid, 15)
            process.wait(30)


def _wait(address: str, process: "subprocess.Popen[bytes]", log: Path) -> None:
    until = time.monotonic() + 120
    while time.monotonic() < until:
        assert process.poll() is None, log.read_text()
        try:
            with urllib.request.urlopen(f"{address}/health", timeout=5):
                return
        except OSError:
            time.sleep(0.5)
    raise AssertionError(f"no answer from {address}: {log.read_text()}")


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1366, "height": 900})
    opened = context.new_page()
    opened.set_default_timeout(PATIENCE)
    yield opened
    context.close()


def test_the_page_of_runs_shows_the_reports_numbers_and_lists_all_stages(
    project: Path, server: str, page: Page
) -> None:
    page.goto(f"{server}/{runs_page(*open_store(project))}")
    metric, value = STAGES["report"]
    header = page.get_by_role("columnheader", name=metric).first
    expect(header).to_be_visible(timeout=PATIENCE)
    expect(page.get_by_role("gridcell").filter(has_text=str(value)).first).to_be_visible()
    parent = page.get_by_role("row").filter(
        has=page.get_by_role("link", name=re.compile("^repro@"))
    )
    parent.get_by_role("button").first.click()  # the stages are listed below the pipeline's run
    for stage in STAGES:
        expect(page.get_by_role("link", name=stage, exact=True)).to_be_visible(timeout=PATIENCE)


@pytest.mark.parametrize("stage", STAGES)
def test_the_page_of_a_run_shows_its_metric(
    stage: str, project: Path, server: str, page: Page
) -> None:
    client, experiment = open_store(project)
    (run,) = Store(client, experiment, project)._runs(**{"dvc.stage": stage})
    metric, value = STAGES[stage]
    page.goto(f"{server}/#/experiments/{experiment}/runs/{run.info.run_id}")
    expect(page.get_by_text(stage, exact=True).first).to_be_visible(timeout=PATIENCE)
    row = page.get_by_role("row").filter(has_text=metric)
    expect(row.get_by_text(str(value))).to_be_visible(timeout=PATIENCE)
