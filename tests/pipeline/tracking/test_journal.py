"""The journal: complete, readable after a kill, and never the reason a stage fails."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pipeline.tracking.journal import content_md5, journal, journals_folder, processor
from pipeline.tracking.records import Record, read_record, unreadable_journals, waiting_records
from pipeline.tracking.run import (
    VARIABLE,
    current_pipeline,
    is_running,
    process_identity,
    project_root,
)

REPOSITORY = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("DVC_EXP_NAME", "DVC_EXP_BASELINE_REV", VARIABLE):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DVC_ROOT", str(tmp_path))
    monkeypatch.setenv("DVC_STAGE", "train@toy")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def make_project(folder: Path) -> Path:
    (folder / ".dvc").mkdir(parents=True)
    (folder / "dvc.yaml").touch()
    return folder


def only_record(root: Path) -> Record:
    (record,) = waiting_records(root)
    return record


def test_a_journal_holds_what_the_stage_noted(project: Path) -> None:
    (project / "in.txt").write_text("abc")
    (project / "plots").mkdir()
    (project / "plots" / "curve.csv").write_text("1,2\n")
    before = time.time_ns() // 1_000_000
    with journal(params={"train": {"epochs": 2}}, inputs=[Path("in.txt")]) as notes:
        for step in range(2):
            notes.metrics({"loss": 1.0 / (step + 1)}, step)
        notes.metrics({"best": 0.5, "epochs": 2})
        notes.artifact(Path("plots/curve.csv"))
    record = only_record(project)
    assert record.stage == "train@toy"
    assert (record.status, record.error, record.restored) == ("FINISHED", "", {})
    assert record.params == {"train": {"epochs": 2}}
    assert record.processor == processor() != ""
    assert record.inputs == {"in.txt": "900150983cd24fb0d6963f7d28e17f72"}  # RFC 1321, A.5
    assert [(p.name, p.value, p.step) for p in record.points] == [
        ("loss", 1.0, 0),
        ("loss", 0.5, 1),
        ("best", 0.5, 0),
        ("epochs", 2.0, 0),
    ]
    assert record.artifacts == ("plots/curve.csv",)
    assert (record.folder / "artifacts/plots/curve.csv").read_text() == "1,2\n"
    assert before <= record.start <= record.end <= time.time_ns() // 1_000_000


def test_artifacts_are_copies_that_outlive_the_workspace(project: Path) -> None:
    (project / "view.html").write_text("seen")
    with journal(params={}) as notes:
        notes.artifact(project / "view.html")
        (project / "view.html").unlink()
    assert (only_record(project).folder / "artifacts/view.html").read_text() == "seen"


def test_the_params_are_kept_as_they_were_when_the_stage_started(project: Path) -> None:
    (project / "params.yaml").write_text("steps: 1")
    with journal(params={}):
        (project / "params.yaml").write_text("steps: 4")
    record = only_record(project)
    assert record.params_file.read_text() == "steps: 1"
    assert record.artifacts == (), "each stage's run would carry a copy"


def test_an_exception_ends_the_journal_as_failed_and_goes_on(project: Path) -> None:
    with pytest.raises(ValueError, match="no pairs"), journal(params={}):
        raise ValueError("no pairs")
    record = only_record(project)
    assert (record.status, record.error) == ("FAILED", "ValueError: no pairs")


@pytest.mark.parametrize(("code", "status"), [(3, "FAILED"), (0, "FINISHED")])
def test_the_exit_code_survives_the_journal(project: Path, code: int, status: str) -> None:
    with pytest.raises(SystemExit) as caught, journal(params={}):
        sys.exit(code)
    assert caught.value.code == code
    assert only_record(project).status == status


def test_a_stage_that_runs_is_told_from_one_that_was_killed(project: Path) -> None:
    code = (
        "import sys, time\n"
        "from pipeline.tracking.journal import journal\n"
        "with journal(params={'a': 1}) as notes:\n"
        "    notes.metrics({'loss': 0.25}, 7)\n"
        "    print('noted', flush=True)\n"
        "    time.sleep(60)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    stage = subprocess.Popen(
        [sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True
    )
    assert stage.stdout is not None
    assert stage.stdout.readline() == "noted\n"
    assert only_record(project).status == "RUNNING"
    stage.send_signal(signal.SIGKILL)
    stage.wait()
    stage.stdout.close()
    record = only_record(project)
    assert record.status == "KILLED"
    assert [(p.name, p.value, p.step) for p in record.points] == [("loss", 0.25, 7)]


def test_a_torn_last_line_is_ignored() -> None:
    with journal(params={}) as notes:
        notes.metrics({"loss": 1.0})
    with (notes.folder / "journal.jsonl").open("a") as file:
        file.write('{"event": "metr')
    record = read_record(notes.folder)
    assert record is not None
    assert (record.status, len(record.points)) == ("FINISHED", 1)


def test_a_journal_without_a_whole_first_line_is_no_record(project: Path) -> None:
    folder = journals_folder(project) / "torn"
    folder.mkdir(parents=True)
    (folder / "journal.jsonl").write_text('{"event": "sta')
    assert waiting_records(project) == []


@pytest.mark.parametrize("first", ['{"event": "sta', "", "\0" * 40])
def test_a_journal_that_lost_its_first_line_alone_is_named(project: Path, first: str) -> None:
    folder = journals_folder(project) / "torn"
    folder.mkdir(parents=True)
    rest = '{"event": "metrics", "values": {"loss": 1.0}, "step": null, "time": 1}\n'
    (folder / "journal.jsonl").write_text(f"{first}\n{rest}")
    assert waiting_records(project) == []
    (said,) = unreadable_journals(project)
    assert said.startswith("journal torn cannot be read: its first line, which says of what stage")


def test_a_folder_that_cannot_be_written_costs_a_warning_only(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (project / ".pcrdiff").write_text("a file where a folder is needed")
    with journal(params={}) as notes:
        notes.metrics({"loss": 1.0})
        notes.artifact(Path(__file__))
    assert "pcrdiff journal: nothing of this stage will reach MLflow" in capsys.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's /dev/full")
def test_a_full_disk_costs_a_warning_only(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Path("/dev/full").open("a") as full, journal(params={}) as notes:
        monkeypatch.setattr(notes, "_file", full)
        notes.metrics({"loss": 1.0})
    assert "No space left on device" in capsys.readouterr().err


def test_values_that_are_no_numbers_and_missing_files_cost_a_warning_only(
    project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with journal(params={}, inputs=[Path("gone.h5")]) as notes:
        notes.metrics({"loss": "high"})  # type: ignore[dict-item]
        notes.artifact(Path("gone.png"))
    warnings = capsys.readouterr().err
    assert all(word in warnings for word in ("gone.h5", "['loss']", "gone.png"))
    assert only_record(project).status == "FINISHED"


def test_stages_of_one_dvc_command_share_a_pipeline_and_of_two_do_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    dvc = tmp_path / "dvc"  # stands for the dvc program: a parent process of this name
    stage = "from pipeline.tracking.run import current_pipeline; print(current_pipeline().key)"
    command = [sys.executable, "-c", stage]
    dvc.write_text(f"import subprocess\nfor _ in 'ab':\n    subprocess.run({command!r})\n")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    runs = [
        subprocess.run([sys.executable, str(dvc)], capture_output=True, text=True).stdout.split()
        for _ in range(2)
    ]
    assert all(len(keys) == 2 and len(set(keys)) == 1 for keys in runs), runs
    assert runs[0][0] != runs[1][0]
    assert all(keys[0].startswith("repro:") for keys in runs)


def test_an_experiment_is_one_pipeline_whatever_started_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("DVC_EXP_NAME", "parky-pein")
    monkeypatch.setenv("DVC_EXP_BASELINE_REV", "0123456789" * 4)
    monkeypatch.setenv(VARIABLE, "someone")
    pipeline = current_pipeline()
    assert (pipeline.key, pipeline.name) == ("exp:parky-pein@0123456", "parky-pein@0123456")


def test_a_process_whose_name_is_no_text_has_an_identity(tmp_path: Path) -> None:
    """Any command may stand above a stage; its name is bytes, with brackets and blanks too."""
    named = tmp_path / os.fsdecode(b"a) \xe4 (")
    named.symlink_to(shutil.which("sleep") or "sleep")
    child = subprocess.Popen([named, "100"])
    try:
        identity = process_identity(child.pid)
        assert identity.split("-")[2].isdigit()
        assert is_running(identity)
    finally:
        child.kill()
        child.wait()


def test_a_process_has_one_identity_for_ever() -> None:
    mine = process_identity(os.getpid())
    assert mine == process_identity(os.getpid())
    assert is_running(mine)
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    identity = process_identity(child.pid)
    assert is_running(identity)
    child.communicate(b"\n")
    assert not is_running(identity)
    assert not is_running("")


def test_without_dvc_the_journal_lies_at_the_top_of_the_project(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DVC_ROOT")
    monkeypatch.delenv("DVC_STAGE")
    subprocess.run(["git", "init", "--quiet"], check=True)
    make_project(project)
    (project / "deep").mkdir()
    monkeypatch.chdir(project / "deep")
    assert project_root() == project.resolve()
    with journal(params={}):
        pass
    assert only_record(project).pipeline.key == "manual@nogit"


@pytest.mark.parametrize("outer", ["with git", "with git and DVC", "without git"])
def test_the_project_is_found_by_its_own_files_whatever_it_lies_in(
    project: Path, monkeypatch: pytest.MonkeyPatch, outer: str
) -> None:
    monkeypatch.delenv("DVC_ROOT")
    if outer != "without git":
        subprocess.run(["git", "init", "--quiet"], check=True)
    if "DVC" in outer:
        make_project(project)
    inner = make_project(project / "vendor" / "pcrdiff")
    (inner / "deep").mkdir()
    (inner / "deep" / "dvc.yaml").touch()  # DVC's pipelines may lie deeper; the project does not
    monkeypatch.chdir(inner / "deep")
    assert project_root() == inner.resolve()


@pytest.mark.parametrize("there", ["nothing", "dvc.yaml", ".dvc"])
def test_a_folder_that_is_no_project_is_one_sentence(
    project: Path, monkeypatch: pytest.MonkeyPatch, there: str
) -> None:
    monkeypatch.delenv("DVC_ROOT")
    subprocess.run(["git", "init", "--quiet"], check=True)
    if there == "dvc.yaml":
        (project / "dvc.yaml").touch()
    elif there == ".dvc":
        (project / ".dvc").mkdir()
    with pytest.raises(FileNotFoundError, match=r"dvc\.yaml and \.dvc is needed") as refused:
        project_root()
    assert str(project) in str(refused.value)


def test_what_dvc_says_is_the_root_goes_before_what_lies_around(project: Path) -> None:
    make_project(project / "temporary")
    os.chdir(project / "temporary")
    assert project_root() == project.resolve()


def test_the_md5_of_a_folder_is_that_of_its_sorted_list(project: Path) -> None:
    folder = project / "data"
    (folder / "__pycache__").mkdir(parents=True)
    (folder / "b").write_text("")
    (folder / "a").write_text("abc")
    before = content_md5(folder)
    (folder / "__pycache__" / "x.pyc").write_text("bytecode")
    assert content_md5(folder) == before
    assert before.endswith(".dir")
    (folder / "b").write_text("other")
    assert content_md5(folder) != before


def test_the_journal_imports_neither_mlflow_nor_torch() -> None:
    code = "import json, sys, pipeline.tracking.journal; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, stdout=subprocess.PIPE)
    loaded = {name.split(".")[0] for name in json.loads(done.stdout)}
    assert not loaded & {"mlflow", "torch", "dvc", "numpy"}
