"""The runs in MLflow: one for a run of the pipeline, below it one for each stage that did work."""

import json
import posixpath
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pipeline.formats.yaml_files import flat, read_yaml
from pipeline.settings.profiles import profile_values
from pipeline.tracking.journal import ARTIFACTS
from pipeline.tracking.records import Point, Record
from pipeline.tracking.run import Pipeline, is_running

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import DatasetInput, Run

T = TypeVar("T")

BATCH = 900  # metrics in one request; MLflow takes 1000 of everything
PARAMS_BATCH = 100  # params or tags MLflow takes in one request
LONGEST_VALUE = 5000  # characters of a param or tag MLflow stores everywhere
LONGEST_DATASET = 500  # characters of the name of a data set
LONGEST_NOTE = 300  # characters of a description that a table of runs can show
NOT_HERE = "not in this store"
"""Instead of the run that made what was restored; it may have come from a remote cache."""
VIEW = "pcrdiff"
VIEW_TAG = f"mlflow.sharedViewState.{VIEW}"
"""MLflow's pages keep in this tag of an experiment the view that ``?viewStateShareKey=`` names."""
ATTRIBUTES = ("attributes.`Duration`", "attributes.`Description`")
MOST_COLUMNS = 20
FILTERABLE = re.compile(r"[\w.:@/+ -]*")  # what stands between quotes in every filter as it is


@dataclass(frozen=True)
class Store:
    """The experiment in MLflow: a parent run for each pipeline run, a child for each stage."""

    client: "MlflowClient"
    experiment: str
    root: Path
    """The project, whose profiles say what is usual."""
    parents: dict[str, str] = field(default_factory=dict)
    """The runs of the pipelines met so far, by key."""

    def send(self, record: Record) -> None:
        """Make the run of one journal, unless it is there whole; a half one is made again.

        The journal of what DVC restored makes none: the pipeline's run links to those there are.
        """
        if record.restored:
            self._link(self._parent(record), record.restored)
            return
        for run in self._runs(**{"pcrdiff.journal": record.id}):
            if run.info.status != "RUNNING":
                return
            self.client.delete_run(run.info.run_id)
        parent = self._parent(record)
        tags = {**_tags(record), "mlflow.parentRunId": parent}
        run = self.client.create_run(self.experiment, record.start, tags, record.stage)
        self._fill(run.info.run_id, record)
        if record.stage == "report":
            self._headline(parent, record.points)
        self.client.set_terminated(run.info.run_id, record.status, record.end)

    def close_pipelines(self, sent: set[str], running: set[str], finished: str) -> None:
        """End the parents of what was sent, and those an earlier sync had to leave open."""
        runs = self._runs(**{"pcrdiff.kind": "pipeline"})
        keys = {run.data.tags["pcrdiff.pipeline"] for run in runs if run.info.status == "RUNNING"}
        for key in sorted((keys | sent) - running):
            for parent in self._parents(key)[:1]:
                alive = is_running(parent.data.tags.get("pcrdiff.invocation", ""))
                if key == finished or not alive:
                    self._close(parent)

    def _parent(self, record: Record) -> str:
        """Find, once, or make the run of the pipeline; if several hosts made one, the oldest."""
        pipeline = record.pipeline
        if pipeline.key in self.parents:
            return self.parents[pipeline.key]
        found = self._parents(pipeline.key)
        if not found:
            tags = {"pcrdiff.kind": "pipeline", **_pipeline_tags(pipeline)}
            found = [self.client.create_run(self.experiment, record.start, tags, pipeline.name)]
        run = found[0]
        parent = str(run.info.run_id)
        if "profile" not in run.data.params and record.params_file.is_file():
            self._describe(parent, record.params_file)
        self.parents[pipeline.key] = parent
        return parent

    def _describe(self, parent: str, params_file: Path) -> None:
        """Say on a pipeline's run what it was asked for; the profile comes last, as the sign of it."""
        profile, changed = deviations(self.root, params_file)
        words = [f"profile {profile}", *(f"{key}={value}" for key, value in changed.items())]
        note = textwrap.shorten(", ".join(words), LONGEST_NOTE, placeholder=" ...")
        self.client.set_tag(parent, "mlflow.note.content", note, synchronous=True)
        self.client.log_artifact(parent, str(params_file))
        self._log(parent, {**changed, "profile": profile}, [])

    def _link(self, parent: str, restored: Mapping[str, Mapping[str, str]]) -> None:
        """Name on a pipeline's run, for each stage DVC restored, the run that made its outputs."""
        from mlflow.entities import RunTag

        tags = [RunTag("pcrdiff.restored", str(len(restored)))]
        for stage, outputs in restored.items():
            marks = {"dvc.stage": stage, **_digests("output", outputs)}
            made = self._runs(**marks) if outputs else []
            maker = str(made[-1].info.run_id) if made else NOT_HERE
            tags.append(RunTag(_key(f"pcrdiff.restored.{stage}"), maker))
        for some in _batches(tags, PARAMS_BATCH):
            self.client.log_batch(parent, tags=some, synchronous=True)

    def _parents(self, key: str) -> "list[Run]":
        return self._runs(**{"pcrdiff.pipeline": key, "pcrdiff.kind": "pipeline"})

    def _close(self, parent: "Run") -> None:
        """End a pipeline run as its stages ended; of a stage that ran twice, the later counts."""
        children = self._runs(**{"mlflow.parentRunId": parent.info.run_id})
        last = {run.data.tags.get("dvc.stage", ""): run for run in children}
        good = all(run.info.status == "FINISHED" for run in last.values())
        end = max((run.info.end_time or 0 for run in children), default=parent.info.start_time)
        self.client.set_terminated(parent.info.run_id, "FINISHED" if good else "FAILED", end)

    def _headline(self, parent: str, points: Sequence[Point]) -> None:
        """Give a pipeline's run the report's numbers, and the page of runs a view that shows them."""
        self._log(parent, {}, points)
        names = dict.fromkeys(_key(point.name) for point in points)
        shown = [*ATTRIBUTES, *(f"metrics.`{name}`" for name in names)][:MOST_COLUMNS]
        view = json.dumps({"selectedColumns": shown})
        self.client.set_experiment_tag(self.experiment, VIEW_TAG, view)

    def _fill(self, run_id: str, record: Record) -> None:
        self._log(run_id, _params(record.params), record.points)
        datasets = [_dataset(path, md5) for path, md5 in sorted(record.inputs.items())]
        for batch in _batches(datasets, PARAMS_BATCH):
            self.client.log_inputs(run_id, batch)
        for path in record.artifacts:
            copy, folder = record.folder / ARTIFACTS / path, Path(path).parent.as_posix()
            if copy.is_dir():
                self.client.log_artifacts(run_id, str(copy), path)
            elif copy.exists():
                self.client.log_artifact(run_id, str(copy), None if folder == "." else folder)

    def _log(self, run_id: str, params: Mapping[str, str], points: Sequence[Point]) -> None:
        """Write params and metrics, and wait for them whatever MLflow's variables say."""
        from mlflow.entities import Metric, Param

        some = _batches([Param(*item) for item in params.items()], PARAMS_BATCH)
        several = _batches([Metric(_key(p.name), p.value, p.time, p.step) for p in points], BATCH)
        for few, many in zip_longest(some, several, fillvalue=()):
            self.client.log_batch(run_id, metrics=many, params=few, synchronous=True)

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


def runs_page(client: "MlflowClient", experiment: str) -> str:
    """Return where MLflow's pages list the runs, with the report's numbers once there is a report."""
    known = VIEW_TAG in client.get_experiment(experiment).tags
    return f"#/experiments/{experiment}/runs" + (f"?viewStateShareKey={VIEW}" if known else "")


def _tags(record: Record) -> dict[str, str]:
    tags = {"pcrdiff.kind": "stage", "pcrdiff.journal": record.id, "dvc.stage": record.stage}
    tags |= _pipeline_tags(record.pipeline)
    tags |= _digests("input", record.inputs) | _digests("output", record.outputs)
    if record.processor:
        tags["pcrdiff.processor"] = record.processor
    if record.error:
        tags["pcrdiff.error"] = record.error[:LONGEST_VALUE]
    return tags


def _digests(kind: str, digests: Mapping[str, str]) -> dict[str, str]:
    return {_key(f"{kind}.{path}"): md5 for path, md5 in digests.items()}


def _pipeline_tags(pipeline: Pipeline) -> dict[str, str]:
    tags = {
        "pcrdiff.pipeline": pipeline.key,
        "pcrdiff.invocation": pipeline.invocation,
        "dvc.exp": pipeline.experiment,
        "dvc.baseline": pipeline.baseline,
        "mlflow.source.git.commit": pipeline.revision,
    }
    return {name: value for name, value in tags.items() if value}


def deviations(root: Path, params_file: Path) -> tuple[str, dict[str, str]]:
    """Return the profile that a params.yaml names, and ``a.b.c``, text where it differs from it.

    A value that the profile alone has is ``absent``. Where there is nothing to compare with, since
    the file names no profile or that cannot be read, no value is returned.
    """
    profile = "unknown"
    try:
        values = dict(read_yaml(params_file))
        profile = str(values.get("profile", profile))
        usual = _params(profile_values(root, profile))
    except (OSError, TypeError, ValueError):
        return profile, {}
    given = _params(values)
    changed = [key for key in sorted({*usual, *given}) if usual.get(key) != given.get(key)]
    return profile, {key: given.get(key, "absent") for key in changed if key != "profile"}


def _params(values: Mapping[str, object]) -> dict[str, str]:
    """Return nested params as ``a.b.c`` -> text; what is no text as JSON."""
    found = flat(values).items()
    texts = [(key, v if isinstance(v, str) else json.dumps(v, default=str)) for key, v in found]
    return {_key(key): text[:LONGEST_VALUE] for key, text in texts}


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
