"""Ships journals to MLflow: the one module that imports it. Anything may be shipped twice, once counts."""

import json
import logging
import os
import posixpath
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from filelock import FileLock, Timeout

from pipeline.invocation import Pipeline, current_pipeline, is_running, project_root
from pipeline.mlflow_store import (
    artifacts_folder,
    check_database,
    database_file,
    public,
    tracking_uri,
    wanted_store,
)
from pipeline.records import Record, shipped_records, unreadable_journals, waiting_records
from pipeline.restored import note_restored
from pipeline.tracking import ARTIFACTS, journals_folder

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import DatasetInput, Run

T = TypeVar("T")

EXPERIMENT = "pcrdiff"
LOCK_SECONDS = 120.0
DATABASE_ATTEMPTS = 4  # MLflow's own 10 take 100 s; it has no variable for them
BATCH = 1000  # metrics MLflow takes in one request
PARAMS_BATCH = 100  # params or tags MLflow takes in one request
LONGEST_VALUE = 5000  # characters of a param or tag MLflow stores everywhere
LONGEST_DATASET = 500  # characters of the name of a data set
FILTERABLE = re.compile(r"[\w.:@/+ -]*")  # what stands between quotes in every filter as it is
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
    """Stage runs sent now that ran."""
    restored: int = 0
    """Stage runs sent now that DVC took from its cache."""
    waiting: int = 0
    """Journals left on disk: their stages still run, or the store failed."""
    problems: tuple[str, ...] = ()
    """One sentence for each thing that went wrong; nothing is lost, a later sync tries again."""

    def sentence(self) -> str:
        """Say it in one line."""
        counts = f"{self.shipped} stage runs and {self.restored} restored ones sent"
        line = f"{counts} to {self.store}, {self.waiting} waiting"
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
        with _locked(root):
            try:
                _add_restored(root, workspace, finished or _last_finished(root, workspace))
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
    with _store_lock(root, uri):
        client = MlflowClient(tracking_uri=uri, registry_uri=uri)
        experiment = client.get_experiment_by_name(EXPERIMENT)
        if experiment is None:
            return client, client.create_experiment(EXPERIMENT, artifacts_folder(uri, root))
    if experiment.lifecycle_stage == "deleted":
        command = f"mlflow experiments restore -x {experiment.experiment_id}"
        raise ValueError(f"the experiment {EXPERIMENT!r} was deleted; `{command}` brings it back")
    return client, str(experiment.experiment_id)


def _locked(root: Path) -> FileLock:
    """One sync at a time on one project."""
    folder = root / ".pcrdiff"
    folder.mkdir(parents=True, exist_ok=True)
    return FileLock(folder / "mlflow-sync.lock", timeout=LOCK_SECONDS)


def _store_lock(root: Path, uri: str) -> FileLock:
    """One creator at a time of one SQLite file, also when several projects share it."""
    path = database_file(uri) or root / "server"
    folder = path.parent / ".pcrdiff"
    folder.mkdir(parents=True, exist_ok=True)
    return FileLock(folder / f"{path.name}.lock", timeout=LOCK_SECONDS)


def _last_finished(root: Path, workspace: Path) -> Pipeline | None:
    """Return the newest pipeline run of the workspace, unless it still runs."""
    records = [*shipped_records(root), *waiting_records(root)]
    here = [r for r in records if r.workspace == str(workspace.resolve()) and not r.restored]
    if not here:
        return None
    newest = max(here, key=lambda record: record.start).pipeline
    alive = is_running(newest.invocation) or newest.key.startswith("manual@")
    return None if alive else newest


def _add_restored(root: Path, workspace: Path, pipeline: Pipeline | None) -> None:
    """Write the journals of what DVC restored in this pipeline run."""
    if pipeline is None:
        return
    records = [*shipped_records(root), *waiting_records(root)]
    ran = [record for record in records if record.pipeline.key == pipeline.key]
    note_restored(root, workspace, pipeline, ran)


def _ship(root: Path, finished: str) -> SyncReport:
    """Send every journal whose stage has ended, then close the pipeline runs."""
    waiting = waiting_records(root)
    ready = [record for record in waiting if record.status != "RUNNING"]
    client, experiment = open_store(root)
    store = Store(client, experiment)
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
    restored = sum(record.restored for record in sent)
    ran, name = len(sent) - restored, public(tracking_uri(root))
    return SyncReport(name, ran, restored, left - len(sent), tuple(problems))


def _retire(record: Record, root: Path) -> None:
    """Keep the lines of a shipped journal, not its artifacts."""
    done = journals_folder(root) / "done"
    done.mkdir(exist_ok=True)
    shutil.rmtree(record.folder / ARTIFACTS, ignore_errors=True)
    record.folder.rename(done / record.id)


@dataclass(frozen=True)
class Store:
    """The experiment in MLflow: a parent run for each pipeline run, a child for each stage."""

    client: "MlflowClient"
    experiment: str

    def send(self, record: Record) -> None:
        """Make the run of one journal, unless it is there whole; a half one is made anew."""
        for run in self._runs(**{"pcrdiff.journal": record.id}):
            if run.info.status != "RUNNING":
                return
            self.client.delete_run(run.info.run_id)
        parent = self._parent(record)
        tags = {**_tags(record), "mlflow.parentRunId": parent}
        run = self.client.create_run(self.experiment, record.start, tags, record.stage)
        self._fill(run.info.run_id, record)
        if record.stage == "report":
            self._headline(parent, record)
        self.client.set_terminated(run.info.run_id, record.status, record.end)

    def close_pipelines(self, sent: set[str], running: set[str], finished: str) -> None:
        """End the parents of what was sent, and those an earlier sync had to leave open."""
        keys = {run.data.tags["pcrdiff.pipeline"] for run in self._open_parents()}
        for key in sorted((keys | sent) - running):
            for parent in self._parents(key)[:1]:
                alive = is_running(parent.data.tags.get("pcrdiff.invocation", ""))
                if key == finished or not alive:
                    self._close(parent)

    def _parent(self, record: Record) -> str:
        """Return the run of the pipeline; if several hosts made one at once, the oldest."""
        pipeline = record.pipeline
        for run in self._parents(pipeline.key):
            return str(run.info.run_id)
        tags = {"pcrdiff.kind": "pipeline", **_pipeline_tags(pipeline)}
        run = self.client.create_run(self.experiment, record.start, tags, pipeline.name)
        return str(run.info.run_id)

    def _parents(self, key: str) -> "list[Run]":
        return self._runs(**{"pcrdiff.pipeline": key, "pcrdiff.kind": "pipeline"})

    def _open_parents(self) -> "list[Run]":
        runs = self._runs(**{"pcrdiff.kind": "pipeline"})
        return [run for run in runs if run.info.status == "RUNNING"]

    def _close(self, parent: "Run") -> None:
        """End a pipeline run as its stages ended; of a stage that ran twice, the later counts."""
        children = self._runs(**{"mlflow.parentRunId": parent.info.run_id})
        last = {run.data.tags.get("dvc.stage", ""): run for run in children}
        good = all(run.info.status == "FINISHED" for run in last.values())
        end = max((run.info.end_time or 0 for run in children), default=parent.info.start_time)
        self.client.set_terminated(parent.info.run_id, "FINISHED" if good else "FAILED", end)

    def _headline(self, parent: str, record: Record) -> None:
        """Give the pipeline run the report's params and metrics, to compare experiments by."""
        known = self.client.get_run(parent).data.params
        params = {key: value for key, value in _params(record.params) if key not in known}
        self._log(parent, record, params)

    def _fill(self, run_id: str, record: Record) -> None:
        """Write everything a journal holds into its run."""
        self._log(run_id, record, dict(_params(record.params)))
        datasets = [_dataset(path, md5) for path, md5 in sorted(record.inputs.items())]
        for batch in _batches(datasets, PARAMS_BATCH):
            self.client.log_inputs(run_id, batch)
        for path in record.artifacts:
            copy, folder = record.folder / ARTIFACTS / path, Path(path).parent.as_posix()
            if copy.is_dir():
                self.client.log_artifacts(run_id, str(copy), path)
            elif copy.exists():
                self.client.log_artifact(run_id, str(copy), None if folder == "." else folder)

    def _log(self, run_id: str, record: Record, params: Mapping[str, str]) -> None:
        """Write params and metrics, and wait for them whatever MLflow's variables say."""
        from mlflow.entities import Metric, Param

        for some in _batches([Param(*item) for item in sorted(params.items())], PARAMS_BATCH):
            self.client.log_batch(run_id, params=some, synchronous=True)
        metrics = [Metric(_key(p.name), p.value, p.time, p.step) for p in record.points]
        for several in _batches(metrics, BATCH):
            self.client.log_batch(run_id, metrics=several, synchronous=True)

    def _runs(self, **tags: str) -> "list[Run]":
        """Return the runs that carry all these tags, oldest first.

        MLflow's filters know no escape for quotes and backslashes, and some databases compare
        without case: the filter narrows the search as far as it can, and the tags decide.
        """
        plain = {name: value for name, value in tags.items() if FILTERABLE.fullmatch(value)}
        where = " and ".join(f"tags.`{name}` = '{value}'" for name, value in plain.items())
        runs: list[Run] = []
        token: str | None = ""
        while token is not None:
            page = self.client.search_runs(
                [self.experiment], where, order_by=["start_time ASC"], page_token=token or None
            )
            runs += [run for run in page if tags.items() <= run.data.tags.items()]
            token = page.token or None
        return runs


def _tags(record: Record) -> dict[str, str]:
    """Return the tags of a stage's run."""
    tags = {"pcrdiff.kind": "stage", "pcrdiff.journal": record.id, "dvc.stage": record.stage}
    tags |= _pipeline_tags(record.pipeline)
    tags |= {_key(f"input.{path}"): md5 for path, md5 in record.inputs.items()}
    tags |= {_key(f"output.{path}"): md5 for path, md5 in record.outputs.items()}
    if record.processor:
        tags["pcrdiff.processor"] = record.processor
    if record.restored:
        tags["pcrdiff.restored"] = "true"
    if record.error:
        tags["pcrdiff.error"] = record.error[:LONGEST_VALUE]
    return tags


def _pipeline_tags(pipeline: Pipeline) -> dict[str, str]:
    tags = {
        "pcrdiff.pipeline": pipeline.key,
        "pcrdiff.invocation": pipeline.invocation,
        "dvc.exp": pipeline.experiment,
        "dvc.baseline": pipeline.baseline,
        "mlflow.source.git.commit": pipeline.revision,
    }
    return {name: value for name, value in tags.items() if value}


def _params(values: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Yield ``a.b.c``, text for nested params; lists and empty mappings as JSON."""
    for name, value in values.items():
        key = f"{prefix}{name}"
        if isinstance(value, Mapping) and value:
            yield from _params(value, f"{key}.")
        else:
            text = value if isinstance(value, str) else json.dumps(value)
            yield _key(key), text[:LONGEST_VALUE]


def _dataset(path: str, md5: str) -> "DatasetInput":
    """Return an input as MLflow's UI lists data sets: name, digest, source."""
    from mlflow.entities import Dataset, DatasetInput, InputTag

    source = json.dumps({"uri": path})
    data = Dataset(name=path[:LONGEST_DATASET], digest=md5, source_type="local", source=source)
    return DatasetInput(data, [InputTag("mlflow.data.context", "input")])


def _key(name: str) -> str:
    """Return a name MLflow accepts: letters, digits, ``_-./: ``, at most 250, and no ``a//../b``."""
    key = re.sub(r"[^\w\-./: ]", "_", name)[:250]
    is_path = key == posixpath.normpath(key) and not key.startswith(("..", "/")) and key != "."
    return key if is_path else re.sub(r"^\.+|/", "_", key) or "_"


def _batches(items: Sequence[T], size: int) -> Iterator[Sequence[T]]:
    for start in range(0, len(items), size):
        yield items[start : start + size]


def _first_line(error: Exception) -> str:
    if isinstance(error, Timeout):
        return f"another sync has held {error.lock_file} for {LOCK_SECONDS:.0f} s"
    lines = str(error).strip().splitlines()
    return public(lines[0][:300]) if lines else type(error).__name__
