"""The command line: quick to start, careful with what is yours, one sentence when it refuses."""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from filelock import FileLock
from typer.testing import CliRunner, Result

from pipeline.command import cli
from pipeline.command import plan as planning
from pipeline.command.clean import SETTLING_SECONDS
from pipeline.command.doctor import (
    CHECKS,
    Diagnosis,
    check_code_in_git,
    check_lock,
    check_shell,
    check_weights,
    examine,
)
from pipeline.formats.yaml_files import read_yaml
from pipeline.tracking.journal import journals_folder
from pipeline.tracking.run import VARIABLE
from tests.described import write_yaml

REPOSITORY = Path(__file__).parents[3]
QUICK = (REPOSITORY / "profiles" / "quick.yaml").read_text(encoding="utf-8")
OVERLAY = "# A longer walk.\n\n# What differs.\nprofile: longer\ndiffusion: {steps: 200}\n"
VERBS = ("plan", "repro", "doctor", "clean", "mlflow sync", "real")
LONGER = re.sub(r"\A(?:#.*\n)+", "# A longer walk.\n", QUICK).replace(
    "profile: quick", "profile: longer"
)
LONGER = LONGER.replace("  steps: 1   ", "  steps: 200 ", 1)
"""The text of the profile: quick's, comments included."""


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("DVC_ROOT", "DVC_EXP_NAME", "MLFLOW_TRACKING_URI", VARIABLE):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(tmp_path)
    subprocess.run(["git", "init", "--quiet"], check=True)
    (tmp_path / ".dvc").mkdir()
    (tmp_path / "dvc.yaml").touch()
    (tmp_path / "profiles").mkdir()
    (tmp_path / "profiles" / "quick.yaml").write_text(QUICK)
    (tmp_path / "profiles" / "longer.yaml").write_text(OVERLAY)
    (tmp_path / "params.yaml").write_text(QUICK)
    return tmp_path


def pcrdiff(*words: str) -> Result:
    return CliRunner().invoke(cli.app, words)


def age(path: Path, seconds: float) -> None:
    for some in [path, *path.rglob("*")]:
        os.utime(some, (time.time() - seconds, time.time() - seconds))


def test_help_imports_nothing_slow() -> None:
    code = (
        "import json, sys\nfrom pipeline.command.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, stdout=subprocess.PIPE)
    loaded = {name.split(".")[0] for name in json.loads(done.stdout.splitlines()[-1])}
    assert not loaded & {"torch", "mlflow", "open3d", "dvc", "numpy", "yaml", "filelock"}


def test_as_many_stages_fit_as_cores_that_may_be_used(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of a machine may be more: under taskset, in a container, in SLURM's job."""
    told = (REPOSITORY / "params.yaml").read_text(encoding="utf-8")
    (project / "params.yaml").write_text(told.replace("threads: 1", "threads: 2", 1))
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 4, 5, 6}, raising=False)
    assert cli._fitting_jobs() == 2
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert cli._fitting_jobs() == 1
    monkeypatch.delattr(os, "sched_getaffinity")
    assert cli._fitting_jobs() == 32


def test_a_profile_is_written_with_quicks_comments_and_the_change_is_told(project: Path) -> None:
    result = pcrdiff("profile", "longer")
    assert result.exit_code == 0
    assert (project / "params.yaml").read_text() == LONGER
    assert result.stdout.splitlines() == [
        "diffusion.steps: 1 -> 200",
        "profile: 'quick' -> 'longer'",
        "params.yaml is now longer: 2 values changed",
    ]
    assert pcrdiff("profile", "longer").stdout == "params.yaml is now longer: 0 values changed\n"


def test_a_profile_does_not_overwrite_values_of_your_own_unless_told_to(project: Path) -> None:
    mine = QUICK.replace("  steps: 1 ", "  steps: 17 ", 1)
    (project / "params.yaml").write_text(mine)
    result = pcrdiff("profile", "longer")
    assert result.exit_code == 1
    assert result.stderr.startswith("pcrdiff: params.yaml has values of its own")
    assert (project / "params.yaml").read_text() == mine
    assert pcrdiff("profile", "longer", "--force").exit_code == 0
    assert (project / "params.yaml").read_text() == LONGER


def test_params_without_a_profiles_comments_are_still_that_profile(project: Path) -> None:
    write_yaml(project / "params.yaml", read_yaml(project / "params.yaml"))
    assert "#" not in (project / "params.yaml").read_text()
    assert pcrdiff("profile", "longer").exit_code == 0


def test_the_first_params_may_be_missing(project: Path) -> None:
    (project / "params.yaml").unlink()
    assert pcrdiff("profile", "quick").exit_code == 0
    assert (project / "params.yaml").read_text() == QUICK


def test_an_unknown_profile_is_one_sentence_that_names_the_known() -> None:
    result = pcrdiff("profile", "huge")
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "no profile 'huge'" in result.stderr
    assert "longer, quick" in result.stderr


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (MemoryError(), "pcrdiff: the memory is too small"),
        (OverflowError("int too large"), "pcrdiff: a number is too large: int too large"),
        (RecursionError("depth"), "pcrdiff: something is nested too deeply: depth"),
    ],
)
def test_what_is_too_large_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, error: Exception, expected: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("pipeline.settings.profiles.write_profile", fail)
    done = pcrdiff("profile", "quick")
    assert done.exit_code == 1
    assert done.stderr == f"{expected}\n"


def test_params_that_are_not_yaml_are_one_sentence(project: Path) -> None:
    (project / "params.yaml").write_text("steps: [")
    result = pcrdiff("profile", "longer")
    assert result.exit_code == 1
    assert "params.yaml is not YAML" in result.stderr
    assert result.stderr.count("\n") == 1


def test_plan_names_what_would_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "plan_stages", lambda _, targets: [(targets[0], "it is new")])
    result = pcrdiff("plan", "report")
    assert result.stdout == "report  (it is new)\n1 stages would run\n"


def test_plan_outside_a_dvc_repository_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_ROOT", str(tmp_path))
    (tmp_path / ".dvc").rmdir()
    result = pcrdiff("plan")
    assert result.exit_code == 1
    assert "not inside of a DVC repository" in result.stderr


def test_the_ui_serves_this_projects_store_to_this_machine_only(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(cli, "become_module", lambda *words: asked.append(words))

    def open_store(root: Path) -> tuple[str, str]:
        asked.append((str(root),))
        return "client", "1"

    monkeypatch.setattr("pipeline.tracking.mlflow_sync.open_store", open_store)
    monkeypatch.setattr(
        "pipeline.tracking.mlflow_runs.runs_page", lambda *store: "#/of/".join(store)
    )
    result = pcrdiff("mlflow", "ui", "--port", "5001")
    assert (result.exit_code, result.stdout) == (0, "http://127.0.0.1:5001/client#/of/1\n")
    assert asked[0] == (str(project),), "the tables are made before the server may"
    words = " ".join(asked[1])
    assert words.startswith("mlflow server --host 127.0.0.1 --port 5001")
    assert f"--backend-store-uri sqlite:///{project}/mlflow.db" in words
    assert f"--default-artifact-root {(project / 'mlruns').as_uri()}" in words


def test_the_ui_of_a_server_is_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "https://me:secret@mlflow.example")
    result = pcrdiff("mlflow", "ui")
    assert result.stdout == "the store is a server already: https://mlflow.example\n"


def test_a_sync_that_fails_says_so_and_exits_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "no-such-scheme://here")
    result = pcrdiff("mlflow", "sync")
    assert result.exit_code == 1
    assert "did not answer" in result.stderr
    assert result.stderr.count("\n") == 1


def make_leftovers(root: Path) -> dict[str, Path]:
    """Make one of everything clean looks at; those named old may go."""
    standalone = root / ".dvc" / "tmp" / "exps" / "standalone"
    checkpoints = root / ".pcrdiff" / "checkpoints"
    found = {
        "old experiment": standalone / "tmpdead",
        "new experiment": standalone / "tmpnew",
        "old checkpoint": checkpoints / "aa",
        "new checkpoint": checkpoints / "bb",
        "held checkpoint": checkpoints / "cc",
        "old journal": journals_folder(root) / "done" / "shipped",
        "waiting journal": journals_folder(root) / "waiting",
    }
    for folder in found.values():
        folder.mkdir(parents=True)
        (folder / "file").write_text("x")
        (folder.parent / f"{folder.name}.lock").touch()
    age(found["old experiment"], SETTLING_SECONDS + 60)
    for name in ("old checkpoint", "held checkpoint"):
        age(found[name], 8 * 86400)
    return found


@pytest.mark.skipif(not Path("/proc/self/cwd").exists(), reason="tells dead from living by /proc")
def test_clean_removes_what_is_dead_and_only_that(project: Path) -> None:
    found = make_leftovers(project)
    old = {name for name in found if name.startswith("old")}
    with FileLock(found["held checkpoint"].with_suffix(".lock")):
        listed = pcrdiff("clean", "--dry-run")
        assert listed.stdout.splitlines()[-1] == "3 to remove"
        assert all(path.exists() for path in found.values())
        assert pcrdiff("clean").stdout.splitlines()[-1] == "3 removed"
    assert {name for name, path in found.items() if not path.exists()} == old
    assert not found["old checkpoint"].with_suffix(".lock").exists()
    assert pcrdiff("clean").stdout.splitlines()[-1] == "1 removed", "the one that was held"


@pytest.mark.skipif(not Path("/proc/self/cwd").exists(), reason="tells dead from living by /proc")
def test_clean_keeps_an_experiment_a_process_works_in(project: Path) -> None:
    folder = make_leftovers(project)["old experiment"]
    worker = subprocess.Popen(
        [sys.executable, "-c", "print(1, flush=True); input()"],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert worker.stdout is not None
    worker.stdout.readline()
    pcrdiff("clean")
    assert folder.exists()
    worker.communicate(b"\n")
    pcrdiff("clean")
    assert not folder.exists()


def test_doctor_shows_every_finding_and_fails_on_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def check_broken(_root: Path) -> Iterator[Diagnosis]:
        raise ValueError("steps must be an integer")

    def check_fine(_root: Path) -> Iterator[Diagnosis]:
        yield Diagnosis("ok", "all well")
        yield Diagnosis("warning", "but look")

    monkeypatch.setattr("pipeline.command.doctor.CHECKS", (check_broken, check_fine))
    result = pcrdiff("doctor")
    assert result.exit_code == 1
    assert [line.split() for line in result.stdout.splitlines()] == [
        ["error", "broken:", "steps", "must", "be", "an", "integer"],
        ["ok", "all", "well"],
        ["warning", "but", "look"],
    ]
    monkeypatch.setattr("pipeline.command.doctor.CHECKS", (check_fine,))
    assert pcrdiff("doctor").exit_code == 0


def test_doctor_names_code_that_an_experiment_would_not_commit(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GIT_AUTHOR_NAME", "GIT_COMMITTER_NAME"):
        monkeypatch.setenv(name, "test")
    for name in ("GIT_AUTHOR_EMAIL", "GIT_COMMITTER_EMAIL"):
        monkeypatch.setenv(name, "test@localhost")
    (finding,) = check_code_in_git(project)
    assert finding.level == "error", "no commit yet"
    subprocess.run(["git", "add", "--all"], check=True)
    subprocess.run(["git", "commit", "--quiet", "-m", "start"], check=True)
    (project / "new.py").touch()
    (finding,) = check_code_in_git(project)
    assert finding.level == "warning"
    assert "new.py" in finding.sentence
    subprocess.run(["git", "add", "--all"], check=True)
    (finding,) = check_code_in_git(project)
    assert finding.level == "ok"


def test_doctor_names_torn_weights_and_other_versions(project: Path) -> None:
    (project / "models" / "toy").mkdir(parents=True)
    (project / "models" / "toy" / "cf.safetensors").write_bytes(b"torn")
    (finding,) = check_weights(project)
    assert finding.level == "error"
    assert "models/toy/cf.safetensors cannot be read" in finding.sentence
    (project / "requirements").mkdir()
    (project / "requirements" / "lock.txt").write_text("typer==0.0.1 ; python_version > '3'\n")
    (finding,) = check_lock(project)
    assert finding.level == "warning"
    assert "(locked 0.0.1)" in finding.sentence


@pytest.fixture
def unlisted(monkeypatch: pytest.MonkeyPatch) -> None:
    """The user of a container that was started with a number of its own."""

    def unknown(uid: int) -> None:
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    monkeypatch.setattr("pwd.getpwuid", unknown)
    for name in ("HOME", "LOGNAME", "USER", "LNAME", "USERNAME"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.usefixtures("unlisted")
@pytest.mark.parametrize("missing", ["HOME", "LOGNAME"])
@pytest.mark.parametrize("verb", VERBS)
def test_a_user_without_home_or_name_is_one_sentence(
    project: Path, monkeypatch: pytest.MonkeyPatch, verb: str, missing: str
) -> None:
    if missing == "LOGNAME":
        monkeypatch.setenv("HOME", str(project))
    result = pcrdiff(*verb.split())
    assert result.exit_code == 1
    assert f"user {os.getuid()} is not in" in result.stderr
    assert f"set {missing} to" in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.usefixtures("unlisted")
@pytest.mark.parametrize("name", ["LOGNAME", "USER"])
def test_a_user_who_is_not_listed_may_have_both(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("HOME", str(project))
    monkeypatch.setenv(name, "somebody")
    assert pcrdiff("clean", "--dry-run").exit_code == 0


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("inside", ["another repository", "nothing"])
def test_every_verb_refuses_a_folder_that_is_no_project_and_leaves_nothing_there(
    project: Path, monkeypatch: pytest.MonkeyPatch, inside: str, verb: str
) -> None:
    (project / "dvc.yaml").unlink()
    if inside == "nothing":
        monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(project))
    (project / "deep").mkdir()
    monkeypatch.chdir(project / "deep")
    before = sorted(project.rglob("*"))
    result = pcrdiff(*verb.split())
    assert result.exit_code == 1
    assert "dvc.yaml and .dvc is needed" in result.stderr
    assert result.stderr.count("\n") == 1
    assert sorted(project.rglob("*")) == before


@pytest.mark.parametrize(
    "other",
    [
        "typer==0.0.1 ; python_full_version < '3'",
        "typer==0.0.1 ; sys_platform == 'amiga' \\\n    --hash=sha256:00",
        "typer==0.0.1 ; platform_machine == 'pdp11' and python_version >= '3'",
        "# typer==0.0.1",
        "-r other.txt",
        "no-such-package==1",
    ],
)
def test_a_pin_for_another_machine_is_no_wrong_version(project: Path, other: str) -> None:
    mine = f"typer=={version('typer')} ; python_version > '3'  # via pcrdiff\n"
    (project / "requirements").mkdir()
    for text in (f"{mine}{other}\n", f"{other}\n{mine}"):
        (project / "requirements" / "lock.txt").write_text(text)
        (finding,) = check_lock(project)
        assert finding.level == "ok", finding.sentence


SHELLS = {
    "nologin": "#!/bin/sh\necho This account is currently not available.\nexit 1\n",
    "one that reads no $": "#!/bin/sh\nprintf '%s\\n' '$DVC_ROOT/.venv/bin:$PATH'\n",
    "one that is silent": "#!/bin/sh\nexit 0\n",
}


@pytest.mark.parametrize("kind", [*SHELLS, "one that is not there"])
def test_doctor_names_a_shell_that_dvc_cannot_use(
    project: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    shell = project / "shell"
    if kind in SHELLS:
        shell.write_text(SHELLS[kind])
        shell.chmod(0o755)
    monkeypatch.setenv("SHELL", str(shell))
    (finding,) = check_shell(project)
    assert finding.level == "error"
    assert f"{shell} cannot run" in finding.sentence
    assert "`export SHELL=/bin/sh`" in finding.sentence
    if kind == "nologin":
        assert "not available" in finding.sentence


@pytest.mark.parametrize("shell", [None, "/bin/sh", "/bin/bash"])
def test_doctor_is_content_with_a_shell_that_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shell: str | None
) -> None:
    monkeypatch.delenv("SHELL", raising=False)
    if shell:
        monkeypatch.setenv("SHELL", shell)
    (finding,) = check_shell(tmp_path / "a b")
    assert finding.level == "ok"


def test_every_check_of_doctor_says_something(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = {check.__name__ for check in CHECKS}
    assert {"check_open3d", "check_mlflow", "check_params_file", "check_disk"} <= named
    slow = {"check_open3d", "check_mlflow"}
    quick = tuple(check for check in CHECKS if check.__name__ not in slow)
    monkeypatch.setattr("pipeline.command.doctor.CHECKS", quick)
    (project / "requirements").mkdir()
    (project / "requirements" / "lock.txt").write_text("")
    assert len(list(examine(project))) >= len(quick)
