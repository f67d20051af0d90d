"""The journal and its replay under the real ``dvc``: repro, experiments, restored stages."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.formats.yaml_files import read_yaml
from pipeline.tracking.journal import content_md5
from pipeline.tracking.mlflow_runs import Store
from pipeline.tracking.mlflow_sync import open_store
from pipeline.tracking.records import shipped_records
from pipeline.tracking.run import VARIABLE

REPOSITORY = Path(__file__).parents[3]
STAGE = """
import json, sys
from pathlib import Path
from pipeline.tracking.journal import journal
from pipeline.formats.yaml_files import read_yaml

params = read_yaml(Path("params.yaml"))
name, source, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
with journal(params={name: params[name]}, inputs=[source]) as notes:
    out.parent.mkdir(exist_ok=True)
    out.write_text(json.dumps({"value": params[name]}))
    notes.metrics({"value": params[name]})
if name == "report":
    from pipeline.tracking.mlflow_sync import sync_after_report
    print(sync_after_report().sentence(), file=sys.stderr)
"""
PIPELINE = """
stages:
  train:
    foreach: [a, b]
    do:
      cmd: PYTHON stage.py train raw out/train-${item}.json
      deps: [raw]
      params: [train]
      outs: ["out/train-${item}.json"]
  evaluate:
    cmd: PYTHON stage.py evaluate out/train-a.json out/evaluate.json
    deps: [out/train-a.json]
    params: [evaluate]
    metrics: [out/evaluate.json: {cache: false}]
  report:
    cmd: PYTHON stage.py report out/evaluate.json out/report.json
    deps: [out/evaluate.json, out/train-b.json]
    params: [report]
    outs: [out/report.json]
  unrelated:
    cmd: PYTHON stage.py report raw out/unrelated.json
    deps: [raw]
    params: [report]
    outs: [out/unrelated.json]
"""


def run(*words: str) -> str:
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def dvc(*words: str) -> str:
    return run(sys.executable, "-m", "dvc", *words)


def stages_of_pipelines(root: Path) -> list[dict[str, str]]:
    """Return stage -> the pipeline run that did it, for each pipeline run, oldest first."""
    client, experiment = open_store(root)
    store = Store(client, experiment, root)
    found, before = [], "pcrdiff.restored."
    parents = store._runs(**{"pcrdiff.kind": "pipeline"})
    number = {parent.info.run_id: f"run {n}" for n, parent in enumerate(parents)}
    for parent in parents:
        assert parent.info.status == "FINISHED"
        children = store._runs(**{"mlflow.parentRunId": parent.info.run_id})
        found.append({c.data.tags["dvc.stage"]: number[parent.info.run_id] for c in children})
        assert len(found[-1]) == len(children), "a stage arrived twice"
        for name, run_id in parent.data.tags.items():
            if name.startswith(before):
                maker = client.get_run(run_id).data.tags
                found[-1][maker["dvc.stage"]] = number[maker["mlflow.parentRunId"]]
    return found


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in list(os.environ):
        if name.startswith(("DVC_", "MLFLOW_")) or name == VARIABLE:
            monkeypatch.delenv(name)
    for name in ("GIT_AUTHOR_NAME", "GIT_COMMITTER_NAME"):
        monkeypatch.setenv(name, "test")
    for name in ("GIT_AUTHOR_EMAIL", "GIT_COMMITTER_EMAIL"):
        monkeypatch.setenv(name, "test@localhost")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("DVC_NO_ANALYTICS", "1")
    monkeypatch.chdir(tmp_path)
    run("git", "init", "--quiet")
    dvc("init", "--quiet")
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "dvc.yaml").write_text(PIPELINE.replace("PYTHON", sys.executable))
    (tmp_path / "params.yaml").write_text("train: 1\nevaluate: 2\nreport: 3\n")
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "b").write_text("b")
    (tmp_path / "raw" / "a").write_text("a")
    (tmp_path / ".gitignore").write_text("/.pcrdiff/\n/mlflow.db\n/mlruns/\n/out/\n__pycache__/\n")
    run("git", "add", "--all")
    run("git", "commit", "--quiet", "-m", "start")
    return tmp_path


@pytest.mark.slow
def test_every_stage_of_every_pipeline_run_is_in_mlflow(project: Path) -> None:
    dvc("repro", "report")
    everything = {"train@a", "train@b", "evaluate", "report"}
    assert stages_of_pipelines(project) == [dict.fromkeys(everything, "run 0")]
    lock = read_yaml(project / "dvc.lock")
    assert lock["stages"]["train@a"]["deps"][0]["md5"] == content_md5(project / "raw")
    assert {record.status for record in shipped_records(project)} == {"FINISHED"}

    run("git", "add", "--all")
    run("git", "commit", "--quiet", "-m", "lock")
    dvc("exp", "run", "--quiet", "--name", "more", "-S", "evaluate=5", "--temp", "report")
    dvc("repro", "--quiet", "-s", "unrelated")
    (project / "params.yaml").write_text("train: 1\nevaluate: 7\nreport: 3\n")
    dvc("repro", "--quiet", "report")
    trained = {"train@a": "run 0", "train@b": "run 0"}
    assert stages_of_pipelines(project)[1:] == [
        {**trained, "evaluate": "run 1", "report": "run 1"},
        {"unrelated": "run 2"},
        {**trained, "evaluate": "run 3", "report": "run 3"},
    ]
