"""Shipping journals: each stage run arrives once, whole, below its pipeline run."""

import hashlib
import json
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from pipeline.command.doctor import check_mlflow
from pipeline.settings.profiles import profile_values
from pipeline.tracking.journal import journal, journals_folder
from pipeline.tracking.mlflow_runs import NOT_HERE, VIEW_TAG, Store, deviations, runs_page
from pipeline.tracking.mlflow_sync import open_store, sync, sync_after_report
from pipeline.tracking.records import Record, shipped_records, waiting_records
from pipeline.tracking.run import VARIABLE, process_identity, project_root

if TYPE_CHECKING:
    from mlflow.entities import Run

REPOSITORY = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def empty_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with tables and nothing in them: creating those takes seconds."""
    root = tmp_path_factory.mktemp("store")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        patch.setattr("pipeline.tracking.mlflow_sync.EXPERIMENT", "other")
        open_store(root)
    return root / "mlflow.db"


@pytest.fixture
def bare_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("DVC_EXP_NAME", "DVC_EXP_BASELINE_REV", "MLFLOW_TRACKING_URI", VARIABLE):
        monkeypatch.delenv(name, raising=False)
    root = tmp_path / "project"
    root.mkdir()
    monkeypatch.setenv("DVC_ROOT", str(root))
    monkeypatch.setenv(VARIABLE, "boot-1-1")
    monkeypatch.chdir(root)
    return root


@pytest.fixture
def project(bare_project: Path, empty_store: Path) -> Path:
    shutil.copyfile(empty_store, bare_project / "mlflow.db")
    return bare_project


def run_stage(
    monkeypatch: pytest.MonkeyPatch, stage: str, error: Exception | None = None
) -> Record:
    """Run a stage of the test that reads in.txt, notes a curve and keeps a picture."""
    monkeypatch.setenv("DVC_STAGE", stage)
    Path("in.txt").write_text("abc")
    Path("plots").mkdir(exist_ok=True)
    Path("plots/curve.png").write_bytes(b"picture")
    params = {"train": {"epochs": 3, "sizes": [1, 2]}, "seed": 7}
    try:
        with journal(params=params, inputs=[Path("in.txt")]) as notes:
            for step in range(3):
                notes.metrics({"loss": 3.0 - step}, step)
            notes.artifact(Path("plots/curve.png"))
            if error:
                raise error
    except RuntimeError:
        pass
    return next(r for r in waiting_records(project_root()) if r.folder == notes.folder)


def runs(root: Path, kind: str) -> "list[Run]":
    client, experiment = open_store(root)
    found: list[Run] = Store(client, experiment, root)._runs(**{"pcrdiff.kind": kind})
    return found


def by_stage(root: Path) -> "dict[str, Run]":
    found = runs(root, "stage")
    stages = {run.data.tags["dvc.stage"]: run for run in found}
    assert len(stages) == len(found), "a stage arrived twice"
    return stages


def linked(root: Path) -> dict[str, str]:
    """Stage -> run of what DVC restored in the newest pipeline run, by the tags of its run."""
    tags, before = runs(root, "pipeline")[-1].data.tags, "pcrdiff.restored."
    found = {name.removeprefix(before): v for name, v in tags.items() if name.startswith(before)}
    assert tags.get("pcrdiff.restored", "0") == str(len(found))
    return found


def test_a_stage_arrives_with_all_that_its_journal_holds(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_EXP_NAME", "parky-pein")
    monkeypatch.setenv("DVC_EXP_BASELINE_REV", "a" * 40)
    record = run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.restored, report.waiting, report.problems) == (1, 0, 0, ())
    client, _ = open_store(project)
    (run,) = runs(project, "stage")
    (parent,) = runs(project, "pipeline")
    assert run.data.params == {"train.epochs": "3", "train.sizes": "[1, 2]", "seed": "7"}
    history = client.get_metric_history(run.info.run_id, "loss")
    assert [(m.step, m.value) for m in history] == [(0, 3.0), (1, 2.0), (2, 1.0)]
    assert (run.info.start_time, run.info.end_time) == (record.start, record.end)
    assert (run.info.status, run.info.run_name) == ("FINISHED", "train@toy")
    md5 = hashlib.md5(b"abc").hexdigest()
    assert run.inputs is not None
    (data,) = run.inputs.dataset_inputs
    assert (data.dataset.name, data.dataset.digest) == ("in.txt", md5)
    expected = {
        "input.in.txt": md5,
        "dvc.exp": "parky-pein",
        "dvc.baseline": "a" * 40,
        "pcrdiff.pipeline": "exp:parky-pein@aaaaaaa",
        "pcrdiff.journal": record.id,
        "mlflow.parentRunId": parent.info.run_id,
    }
    assert expected.items() <= run.data.tags.items()
    assert (parent.info.status, parent.info.run_name) == ("FINISHED", "parky-pein@aaaaaaa")
    assert (parent.info.start_time, parent.info.end_time) == (record.start, record.end)


def test_artifacts_are_there_when_the_workspace_and_the_journal_are_gone(
    project: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    workspace = tmp_path / "temporary"
    workspace.mkdir()
    monkeypatch.chdir(workspace)
    monkeypatch.setenv("DVC_STAGE", "train@toy")
    Path("curve.png").write_bytes(b"picture")
    with journal(params={}) as notes:
        notes.artifact(Path("curve.png"))
    monkeypatch.chdir(project)
    shutil.rmtree(workspace)
    sync(project)
    shutil.rmtree(project / ".pcrdiff")
    client, _ = open_store(project)
    (run,) = runs(project, "stage")
    assert run.info.artifact_uri.startswith((project / "mlruns").as_uri())
    path = client.download_artifacts(run.info.run_id, "curve.png", str(tmp_path))
    assert Path(path).read_bytes() == b"picture"


def test_a_second_sync_sends_nothing_even_if_the_marks_are_lost(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = run_stage(monkeypatch, "train@toy")
    assert sync(project).shipped == 1
    (sent,) = runs(project, "stage")
    assert sync(project).shipped == 0
    done = journals_folder(project) / "done" / record.id
    assert not (done / "artifacts").exists(), "copies of artifacts would pile up"
    done.rename(record.folder)  # as if killed between sending and marking
    sync(project)
    (again,) = runs(project, "stage")
    assert again.info.run_id == sent.info.run_id
    assert len(runs(project, "pipeline")) == 1


def test_a_run_that_was_sent_in_part_is_made_again(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_stage(monkeypatch, "train@toy")
    with monkeypatch.context() as patch:
        patch.setattr(Store, "_log", lambda *_: (_ for _ in ()).throw(OSError("cut off")))
        report = sync(project)
    assert (report.shipped, report.waiting) == (0, 1)
    assert "cut off" in report.problems[0]
    sync(project)
    (run,) = runs(project, "stage")
    assert (run.info.status, run.data.metrics["loss"]) == ("FINISHED", 1.0)


def test_a_failed_stage_fails_its_pipeline_run(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_stage(monkeypatch, "preprocess@toy")
    run_stage(monkeypatch, "train@toy", RuntimeError("diverged"))
    sync(project)
    stages = by_stage(project)
    assert stages["preprocess@toy"].info.status == "FINISHED"
    assert stages["train@toy"].info.status == "FAILED"
    assert stages["train@toy"].data.tags["pcrdiff.error"] == "RuntimeError: diverged"
    (parent,) = runs(project, "pipeline")
    assert parent.info.status == "FAILED"


def test_a_stage_that_still_runs_waits_and_keeps_its_pipeline_run_open(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_stage(monkeypatch, "preprocess@toy")
    monkeypatch.setenv("DVC_STAGE", "train@toy")
    with journal(params={}):
        report = sync(project)
        assert (report.shipped, report.waiting) == (1, 1)
        assert runs(project, "pipeline")[0].info.status == "RUNNING"
    assert sync(project).shipped == 1
    assert runs(project, "pipeline")[0].info.status == "FINISHED"


def test_the_report_stage_closes_the_run_that_is_still_running(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, process_identity(os.getpid()))
    run_stage(monkeypatch, "train@toy")
    sync(project)
    assert runs(project, "pipeline")[0].info.status == "RUNNING"
    run_stage(monkeypatch, "report")
    sync_after_report()
    (parent,) = runs(project, "pipeline")
    assert parent.info.status == "FINISHED"
    assert parent.data.metrics["loss"] == 1.0, "the report's numbers stand for the whole run"
    assert set(by_stage(project)) == {"train@toy", "report"}


def test_the_page_of_runs_shows_the_reports_numbers_once_there_is_a_report(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_stage(monkeypatch, "train@toy")
    sync(project)
    client, experiment = open_store(project)
    assert runs_page(client, experiment) == f"#/experiments/{experiment}/runs"
    monkeypatch.setenv("DVC_STAGE", "report")
    with journal(params={}) as notes:
        notes.metrics({f"cf.{n}": 1.0 for n in range(500)})
    assert sync(project).problems == ()
    assert runs_page(client, experiment).endswith("/runs?viewStateShareKey=pcrdiff")
    shown = json.loads(client.get_experiment(experiment).tags[VIEW_TAG])["selectedColumns"]
    assert {"attributes.`Description`", "metrics.`cf.0`"} <= set(shown)
    assert len(shown) == 20, "a page of 500 columns shows nothing"


def write_params(root: Path, profile: str = "quick", **changed: object) -> None:
    """Write the values of a profile of the repository, some of them changed; None removes one."""
    shutil.copytree(REPOSITORY / "profiles", root / "profiles", dirs_exist_ok=True)
    values = profile_values(
        root, profile if (root / f"profiles/{profile}.yaml").exists() else "quick"
    )
    values["profile"] = profile
    values["diffusion"] |= changed
    values["diffusion"] = {k: v for k, v in values["diffusion"].items() if v is not None}
    Path("params.yaml").write_text(json.dumps(values))  # JSON is YAML


def test_a_pipelines_run_has_as_params_what_differs_from_the_profile(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_params(project, steps=4, hypotheses=[1, 2])
    run_stage(monkeypatch, "train@toy")
    Path("params.yaml").write_text("written: afterwards")
    run_stage(monkeypatch, "report")
    assert sync_after_report().problems == ()
    (parent,) = runs(project, "pipeline")
    differs = {"diffusion.hypotheses": "[1, 2]", "diffusion.steps": "4"}
    assert parent.data.params == {"profile": "quick", **differs}
    note = parent.data.tags["mlflow.note.content"]
    assert note == "profile quick, diffusion.hypotheses=[1, 2], diffusion.steps=4"


@pytest.mark.parametrize(
    ("profile", "changed", "expected"),
    [
        ("quick", {}, {}),
        ("quick", {"steps": 4}, {"diffusion.steps": "4"}),
        ("quick", {"sampler": None}, {"diffusion.sampler": "absent"}),
        ("quick", {"eta": 0.5}, {"diffusion.eta": "0.5"}),
        ("real", {}, {}),
        ("real", {"timesteps": 7}, {"diffusion.timesteps": "7"}),
        ("mine", {"steps": 4}, {}),
    ],
)
def test_values_are_compared_with_those_of_the_profile_that_is_named(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    profile: str,
    changed: dict[str, object],
    expected: dict[str, str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write_params(tmp_path, profile, **changed)
    assert deviations(tmp_path, Path("params.yaml")) == (profile, expected)


def test_an_experiment_has_the_params_of_its_own_workspace_though_that_is_gone(
    project: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    workspace = tmp_path / "temporary"
    workspace.mkdir()
    write_params(project)
    monkeypatch.chdir(workspace)
    write_params(project, steps=8)
    run_stage(monkeypatch, "train@toy")
    monkeypatch.chdir(project)
    shutil.rmtree(workspace)
    sync(project)
    (parent,) = runs(project, "pipeline")
    assert parent.data.params == {"profile": "quick", "diffusion.steps": "8"}


def test_what_a_pipeline_was_asked_for_is_completed_where_it_was_cut_off(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_params(project, steps=8)
    run_stage(monkeypatch, "train@toy")
    with monkeypatch.context() as patch:
        patch.setattr(Store, "_log", lambda *_: (_ for _ in ()).throw(OSError("cut off")))
        assert "cut off" in sync(project).problems[0]
    assert sync(project).problems == ()
    (parent,) = runs(project, "pipeline")
    assert parent.data.params == {"profile": "quick", "diffusion.steps": "8"}


@pytest.mark.parametrize("text", ["a: [", "- a", "7", ""])
def test_params_that_cannot_be_read_differ_from_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "params.yaml").write_text(text)
    assert deviations(tmp_path, tmp_path / "params.yaml") == ("unknown", {})


def test_params_that_cannot_be_read_hold_up_no_journal(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("params.yaml").write_text("a: [")
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.problems) == (1, ())
    assert runs(project, "pipeline")[0].data.params == {"profile": "unknown"}


def write_lock(folder: Path, in_md5: str = hashlib.md5(b"abc").hexdigest()) -> None:
    """Write a dvc.lock of three stages, each of which reads what the one before it wrote."""
    text = {
        "schema": "2.0",
        "stages": {
            "preprocess@toy": {"cmd": "p", "outs": [{"path": "in.txt", "md5": in_md5}]},
            "train@toy": {
                "cmd": "t",
                "deps": [{"path": "in.txt", "md5": in_md5}],
                "outs": [{"path": "model", "md5": "b" * 32}],
            },
            "evaluate@toy": {
                "cmd": "e",
                "deps": [{"path": "model", "md5": "b" * 32}],
                "outs": [{"path": "results/toy", "md5": "d" * 32 + ".dir"}],
            },
        },
    }
    (folder / "dvc.lock").write_text(json.dumps(text))  # JSON is YAML


def test_a_stage_that_dvc_restored_makes_no_run_and_is_linked_to_the_one_that_made_it(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    run_stage(monkeypatch, "preprocess@toy")
    run_stage(monkeypatch, "train@toy")
    sync(project)
    first = by_stage(project)
    assert first["train@toy"].data.tags["output.model"] == "b" * 32
    monkeypatch.setenv(VARIABLE, "boot-2-2")
    run_stage(monkeypatch, "evaluate@toy")
    run_stage(monkeypatch, "report")
    report = sync_after_report()
    assert (report.shipped, report.restored, report.problems) == (2, 2, ())
    again = sync_after_report()
    assert (again.shipped, again.restored) == (0, 0)
    assert set(by_stage(project)) == {"preprocess@toy", "train@toy", "evaluate@toy", "report"}
    made_by = {f"{name}_toy": first[f"{name}@toy"].info.run_id for name in ("preprocess", "train")}
    assert linked(project) == made_by
    assert "pcrdiff.restored" not in runs(project, "pipeline")[0].data.tags


def test_a_restored_stage_is_linked_to_no_run_that_made_something_else(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    run_stage(monkeypatch, "train@toy")
    sync(project)
    monkeypatch.setenv(VARIABLE, "boot-2-2")
    lock = (project / "dvc.lock").read_text()
    (project / "dvc.lock").write_text(lock.replace("b" * 32, "e" * 32))
    run_stage(monkeypatch, "report")
    assert sync_after_report().restored == 3
    assert linked(project)["train_toy"] == NOT_HERE


def test_only_what_a_stage_reads_from_counts_as_restored(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    run_stage(monkeypatch, "train@toy")
    assert sync(project).restored == 1
    assert set(linked(project)) == {"preprocess_toy"}, "nothing read what evaluate wrote"


def test_the_reports_entry_in_the_lock_is_that_of_an_earlier_report(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    lock = json.loads((project / "dvc.lock").read_text())
    outs = [{"path": "page.html", "md5": "f" * 32}]
    lock["stages"]["report"] = {"deps": [{"path": "results"}], "outs": outs}
    (project / "dvc.lock").write_text(json.dumps(lock))
    run_stage(monkeypatch, "report")
    sync_after_report()
    assert "output.page.html" not in by_stage(project)["report"].data.tags


def test_the_restored_stages_of_a_temporary_workspace_come_from_its_own_lock(
    project: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    workspace = tmp_path / "temporary"
    workspace.mkdir()
    write_lock(workspace)
    monkeypatch.chdir(workspace)
    monkeypatch.setenv("DVC_STAGE", "report")
    with journal(params={}):
        pass
    assert sync_after_report().restored == 3
    assert set(linked(project)) == {"preprocess_toy", "train_toy", "evaluate_toy"}
    assert set(by_stage(project)) == {"report"}


def test_by_hand_the_newest_run_gets_its_restored_stages_when_it_is_over(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    monkeypatch.setenv(VARIABLE, process_identity(os.getpid()))
    run_stage(monkeypatch, "train@toy")
    assert sync(project).restored == 0, "preprocess may still be about to run"
    monkeypatch.setenv(VARIABLE, "boot-2-2")
    run_stage(monkeypatch, "train@toy")
    assert sync(project).restored == 1
    assert sync(project).restored == 0


def test_a_run_whose_stages_were_sent_while_it_worked_gets_its_restored_ones_afterwards(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project)
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as above:
        monkeypatch.setenv(VARIABLE, process_identity(above.pid))
        run_stage(monkeypatch, "train@toy")
        assert (sync(project).shipped, linked(project)) == (1, {})
    report = sync(project)
    assert (report.shipped, report.restored) == (0, 1)
    assert set(linked(project)) == {"preprocess_toy"}


def test_a_lock_of_another_state_restores_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_lock(project, in_md5="c" * 32)
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.restored) == (1, 0)


def test_a_broken_lock_is_a_problem_and_the_journals_still_arrive(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "dvc.lock").write_text("stages: [")
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert report.shipped == 1
    assert "dvc.lock is not a dvc.lock" in report.problems[0]


def test_a_dead_server_costs_seconds_and_loses_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket() as refused:
        refused.bind(("127.0.0.1", 0))
        port = refused.getsockname()[1]
    for name in ("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "MLFLOW_HTTP_REQUEST_TIMEOUT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://me:secret@127.0.0.1:{port}")
    write_lock(project)
    run_stage(monkeypatch, "train@toy")
    run_stage(monkeypatch, "report")
    began = time.monotonic()
    report = sync_after_report()
    assert time.monotonic() - began < 30
    assert (report.shipped, report.waiting) == (0, 3)
    (problem,) = report.problems
    assert "did not answer" in problem
    assert "3 journals are kept for `pcrdiff mlflow sync`" in problem
    assert "secret" not in report.sentence()
    monkeypatch.delenv("MLFLOW_TRACKING_URI")
    assert sync(project).sentence().startswith("2 stage runs sent, 2 restored stages noted")
    assert set(linked(project)) == {"preprocess_toy", "evaluate_toy"}


def test_a_bad_journal_does_not_hold_up_the_others(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = run_stage(monkeypatch, "train@bad")
    run_stage(monkeypatch, "train@good")
    fill = Store._fill

    def fails_for_bad(self: Store, run_id: str, record: Record) -> None:
        if record.id == bad.id:
            raise ValueError("a name MLflow refuses")
        fill(self, run_id, record)

    monkeypatch.setattr(Store, "_fill", fails_for_bad)
    report = sync(project)
    assert (report.shipped, report.waiting) == (1, 1)
    assert bad.id in report.problems[0]
    assert [record.stage for record in shipped_records(project)] == ["train@good"]


def test_a_disk_that_is_full_loses_nothing_even_where_mlflow_is_told_not_to_wait(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

    def fails(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setenv("MLFLOW_ENABLE_ASYNC_LOGGING", "true")
    run_stage(monkeypatch, "train@toy")
    with monkeypatch.context() as full:
        full.setattr(SqlAlchemyStore, "log_batch", fails)
        report = sync(project)
    assert (report.shipped, report.waiting) == (0, 1)
    assert "No space left on device" in report.problems[0]
    assert sync(project).shipped == 1
    assert by_stage(project)["train@toy"].data.metrics == {"loss": 1.0}


@pytest.mark.parametrize(
    "name", ["don't", 'say"so', "a'b\"c`d", "100%", "it''s;--", "it's\\", "grün'☃", "plain"]
)
def test_an_experiment_arrives_whatever_its_name(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("DVC_EXP_NAME", "plain-other")
    run_stage(monkeypatch, "train@other")
    monkeypatch.setenv("DVC_EXP_NAME", name)
    run_stage(monkeypatch, "preprocess@toy")
    assert sync(project).problems == ()
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.waiting, report.problems) == (1, 0, ())
    parents = [run for run in runs(project, "pipeline") if run.data.tags["dvc.exp"] == name]
    assert len(parents) == 1, "the second stage did not find the run of the first"
    assert parents[0].info.status == "FINISHED"
    above = {stage: run.data.tags["mlflow.parentRunId"] for stage, run in by_stage(project).items()}
    mine = parents[0].info.run_id
    assert above["preprocess@toy"] == above["train@toy"] == mine != above["train@other"]


@pytest.mark.parametrize(
    "line",
    [
        '{"event": "start"}',
        '{"event": "start", "time": "yesterday", "stage": "train@toy"}',
        '{"event": "start", "time": 1, "stage": "a", "workspace": "/", "params": {}, "inputs": {},'
        ' "pipeline": {"colour": "red"}}',
    ],
)
def test_a_journal_that_cannot_be_read_stays_and_is_named_and_the_others_arrive(
    project: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    unreadable = journals_folder(project) / "20260101T000000-unreadable"
    unreadable.mkdir(parents=True)
    (unreadable / "journal.jsonl").write_text(line + "\n")
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.waiting) == (1, 1)
    assert unreadable.name in report.problems[0]
    assert unreadable.is_dir()


def test_a_journal_that_cannot_be_put_away_does_not_hold_up_the_others(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stuck = run_stage(monkeypatch, "train@stuck")
    run_stage(monkeypatch, "train@toy")
    in_the_way = journals_folder(project) / "done" / stuck.id
    in_the_way.mkdir(parents=True)
    (in_the_way / "file").touch()
    report = sync(project)
    assert (report.shipped, report.waiting) == (1, 1)
    assert stuck.id in report.problems[0]
    shutil.rmtree(in_the_way)
    assert sync(project).waiting == 0
    assert set(by_stage(project)) == {"train@stuck", "train@toy"}


def test_names_mlflow_refuses_and_long_curves_arrive(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_STAGE", "train@toy")
    params = {f"p{i}": "x" * 9000 for i in range(150)}
    with journal(params=params) as notes:
        notes.metrics({"recall@5 (%)": 1.0})
        notes.metrics({"nan": float("nan")})
        notes.metrics({"a//b": 1.0, "../c": 2.0, "..": 2.0, "/d": 3.0, "": 4.0})
        for step in range(1500):
            notes.metrics({"loss": step}, step)
    assert sync(project).problems == ()
    client, _ = open_store(project)
    (run,) = runs(project, "stage")
    assert len(run.data.params) == 150
    assert run.data.metrics["recall_5 ___"] == 1.0
    assert {"a__b", "__c", "_d", "_"} <= set(run.data.metrics)
    token_free = client.get_metric_history(run.info.run_id, "loss")
    assert len(token_free) == 1500


@pytest.mark.slow
def test_two_processes_may_create_the_store_at_once(bare_project: Path) -> None:
    code = (
        "from pathlib import Path\n"
        "from pipeline.tracking.mlflow_sync import open_store\n"
        f"print(open_store(Path({str(bare_project)!r}))[1])\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    answers = [process.communicate()[0] for process in started]
    assert [process.returncode for process in started] == [0, 0]
    assert len(set(answers)) == 1


@pytest.mark.parametrize(
    "uri",
    [
        "sqlite://",
        "sqlite:///",
        "sqlite:///:memory:",
        "sqlite:///%3Amemory%3A",
        "sqlite+pysqlite:///:memory:?cache=shared",
        "sqlite:///file::memory:",
        "sqlite:///file:runs?mode=memory&uri=true",
        "sqlite:runs.db",
        "127.0.0.1:5000",
    ],
)
def test_a_store_that_does_not_last_gets_nothing_and_the_journals_stay(
    project: Path, monkeypatch: pytest.MonkeyPatch, uri: str
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.waiting) == (0, 1)
    (problem,) = report.problems
    assert f"MLFLOW_TRACKING_URI={uri}" in problem
    assert "1 journals are kept" in problem
    assert len(waiting_records(project)) == 1
    monkeypatch.delenv("MLFLOW_TRACKING_URI")
    assert sync(project).shipped == 1


ODD_FOLDERS = ["a%2Fb", "a%20b", "a?b#c", "100%", " grün ☃ ", "a;b&c=d+e", 'it\'s "x"', "me:x@[y]"]


@pytest.mark.parametrize("name", ODD_FOLDERS)
def test_runs_and_artifacts_are_found_again_whatever_the_folder_is_called(
    tmp_path: Path, empty_store: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    root = tmp_path / name / "project"
    root.mkdir(parents=True)
    shutil.copyfile(empty_store, root / "mlflow.db")
    check_odd_folder(tmp_path, root, monkeypatch)


@pytest.mark.slow
def test_a_store_is_made_where_it_belongs_whatever_the_folder_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "a%2Fb %20?#ü" / "project"
    root.mkdir(parents=True)
    check_odd_folder(tmp_path, root, monkeypatch)


def check_odd_folder(tmp_path: Path, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Send one journal and read it back from the files where they must lie."""
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setenv("DVC_ROOT", str(root))
    monkeypatch.setenv(VARIABLE, "boot-1-1")
    monkeypatch.chdir(root)
    run_stage(monkeypatch, "train@toy")
    assert sync(root).problems == ()
    with closing(sqlite3.connect(root / "mlflow.db")) as database:
        assert database.execute("SELECT count(*) FROM runs").fetchone() == (2,)
    (picture,) = (root / "mlruns").rglob("curve.png")
    assert picture.read_bytes() == b"picture"
    (run,) = runs(root, "stage")
    client, _ = open_store(root)
    (tmp_path / "copy").mkdir()
    path = client.download_artifacts(run.info.run_id, "plots/curve.png", str(tmp_path / "copy"))
    assert Path(path).read_bytes() == b"picture"
    beside = {path.name for path in root.parents[1].iterdir()}
    assert beside == {root.parent.name, "copy"}, "something was written beside the project"
    assert [finding.level for finding in check_mlflow(root)] == ["ok"]


def test_a_database_that_is_a_folder_costs_no_time_and_no_journal(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{project}")
    run_stage(monkeypatch, "train@toy")
    report = sync(project)
    assert (report.shipped, report.waiting) == (0, 1)
    assert f"{project} is a folder; needed is a file" in report.problems[0]


def test_a_database_that_cannot_be_opened_is_given_up_within_seconds(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{project}")
    monkeypatch.setattr("pipeline.tracking.mlflow_sync.check_database", lambda _: None)
    naps: list[float] = []
    monkeypatch.setattr("mlflow.store.db.utils.time.sleep", naps.append)
    run_stage(monkeypatch, "train@toy")
    assert sync(project).waiting == 1
    assert 0 < sum(naps) < 5
