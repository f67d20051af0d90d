"""Ships journals to MLflow. Anything may be shipped twice, once counts."""

import logging
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from filelock import FileLock, Timeout

from pipeline.tracking.journal import ARTIFACTS, journals_folder
from pipeline.tracking.mlflow_runs import Store
from pipeline.tracking.mlflow_store import (
    artifacts_folder,
    check_database,
    database_file,
    public,
    tracking_uri,
    wanted_store,
)
from pipeline.tracking.records import Record, shipped_records, unreadable_journals, waiting_records
from pipeline.tracking.restored import note_restored
from pipeline.tracking.run import Pipeline, current_pipeline, is_running, project_root

if TYPE_CHECKING:
    from mlflow import MlflowClient

EXPERIMENT = "pcrdiff"
LOCK_SECONDS = 120.0
DATABASE_ATTEMPTS = 4  # MLflow's own 10 take 100 s; it has no variable for them
DEFAULTS = {  # MLflow's own would retry a dead server for minutes
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_DISABLE_TELEMETRY": "true",
}


@dataclass(frozen=True)
class SyncReport:
    """What one sync did."""

    store: str
    """The tracking URI, without a password."""
    shipped: int = 0
    """Stage runs sent now."""
    restored: int = 0
    """Stages noted now that DVC took from its cache: their pipeline's run links to what made them."""
    waiting: int = 0
    """Journals left on disk: their stages still run, or the store failed."""
    problems: tuple[str, ...] = ()
    """One sentence for each thing that went wrong; nothing is lost, a later sync tries again."""

    def sentence(self) -> str:
        """Say it in one line."""
        counts = f"{self.shipped} stage runs sent, {self.restored} restored stages noted"
        line = f"{counts} in {self.store}, {self.waiting} journals waiting"
        return "; ".join([line, *self.problems])


def sync_after_report() -> SyncReport:
    """Ship everything at the end of the report stage, after its own journal is closed."""
    return sync(project_root(), workspace=Path.cwd(), finished=current_pipeline())


def sync(
    root: Path, *, workspace: Path | None = None, finished: Pipeline | None = None
) -> SyncReport:
    """Bring MLflow up to date with the journals and ``dvc.lock``; never raises for the store.

    Args:
        root: The project: its journals, and the default store ``mlflow.db`` and ``mlruns``.
        workspace: The folder with ``dvc.lock``, if not ``root`` (``dvc exp run --temp``).
        finished: The pipeline run whose last stage is calling. By default the newest one of
            ``workspace``, if the command that started it is gone.
    """
    workspace = workspace or root
    problems = []
    try:
        with _lock(root / ".pcrdiff" / "mlflow-sync.lock"):  # one at a time on one project
            try:
                _add_restored(root, workspace, finished)
            except Exception as error:  # noqa: BLE001  tracking never makes a stage fail
                problems.append(f"the restored stages were not added: {_first_line(error)}")
            report = _ship(root, finished.key if finished else "")
    except Exception as error:  # noqa: BLE001  tracking never makes a stage fail
        waiting = len(waiting_records(root)) + len(unreadable_journals(root))
        kept = f"{waiting} journals are kept for `pcrdiff mlflow sync`"
        store = public(wanted_store())
        problems.append(f"MLflow at {store} did not answer: {_first_line(error)}; {kept}")
        return SyncReport(store, waiting=waiting, problems=tuple(problems))
    return replace(report, problems=(*problems, *report.problems))


def open_store(root: Path) -> "tuple[MlflowClient, str]":
    """Connect, and create the tables and the experiment if they are not there.

    Two processes that create the tables of one SQLite file at once break it, hence the lock.

    Returns:
        The client and the id of the experiment.
    """
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)
    uri = tracking_uri(root)
    database = database_file(uri)
    if database:
        check_database(database)
    from mlflow import MlflowClient
    from mlflow.store.db import utils as engines

    engines.MAX_RETRY_COUNT = DATABASE_ATTEMPTS
    logging.getLogger("mlflow").setLevel(logging.WARNING)
    logging.getLogger("alembic").setLevel(logging.WARNING)
    logging.getLogger(engines.__name__).setLevel(logging.CRITICAL)  # it raises what it logs
    path = database or root / "server"
    with _lock(path.parent / ".pcrdiff" / f"{path.name}.lock"):  # projects may share a database
        client = MlflowClient(tracking_uri=uri, registry_uri=uri)
        experiment = client.get_experiment_by_name(EXPERIMENT)
        if experiment is None:
            return client, client.create_experiment(EXPERIMENT, artifacts_folder(uri, root))
    if experiment.lifecycle_stage == "deleted":
        command = f"mlflow experiments restore -x {experiment.experiment_id}"
        raise ValueError(f"the experiment {EXPERIMENT!r} was deleted; `{command}` brings it back")
    return client, str(experiment.experiment_id)


def _lock(path: Path) -> FileLock:
    path.parent.mkdir(parents=True, exist_ok=True)
    return FileLock(path, timeout=LOCK_SECONDS)


def _add_restored(root: Path, workspace: Path, finished: Pipeline | None) -> None:
    """Write the journal of what DVC restored in the pipeline run that has finished, if one has."""
    records = [r for r in (*shipped_records(root), *waiting_records(root)) if not r.restored]
    pipeline = finished or _last_finished(records, workspace)
    if pipeline:
        ran = [record for record in records if record.pipeline.key == pipeline.key]
        note_restored(root, workspace, pipeline, ran)


def _last_finished(records: Sequence[Record], workspace: Path) -> Pipeline | None:
    """Return the newest pipeline run of the workspace, unless it still runs."""
    here = [record for record in records if record.workspace == str(workspace.resolve())]
    if not here:
        return None
    newest = max(here, key=lambda record: record.start).pipeline
    alive = is_running(newest.invocation) or newest.key.startswith("manual@")
    return None if alive else newest


def _ship(root: Path, finished: str) -> SyncReport:
    """Send every journal whose stage has ended, then close the pipeline runs."""
    waiting = waiting_records(root)
    ready = [record for record in waiting if record.status != "RUNNING"]
    client, experiment = open_store(root)
    store = Store(client, experiment, root)
    sent, problems = [], unreadable_journals(root)
    left = len(waiting) + len(problems)
    for record in ready:
        try:
            store.send(record)
            _retire(record, root)
        except Exception as error:  # noqa: BLE001  one bad journal does not hold up the others
            problems.append(f"journal {record.id} was not sent: {_first_line(error)}")
            client.get_experiment(experiment)  # raises, and so stops, if the store is gone
        else:
            sent.append(record)
    running = {record.pipeline.key for record in waiting if record.status == "RUNNING"}
    store.close_pipelines({record.pipeline.key for record in sent}, running, finished)
    ran = sum(not record.restored for record in sent)
    restored = sum(len(record.restored) for record in sent)
    name = public(tracking_uri(root))
    return SyncReport(name, ran, restored, left - len(sent), tuple(problems))


def _retire(record: Record, root: Path) -> None:
    """Keep the lines of a shipped journal, not its artifacts."""
    done = journals_folder(root) / "done"
    done.mkdir(exist_ok=True)
    shutil.rmtree(record.folder / ARTIFACTS, ignore_errors=True)
    record.folder.rename(done / record.id)


def _first_line(error: Exception) -> str:
    if isinstance(error, Timeout):
        return f"another sync has held {error.lock_file} for {LOCK_SECONDS:.0f} s"
    lines = str(error).strip().splitlines()
    return public(lines[0][:300]) if lines else type(error).__name__
