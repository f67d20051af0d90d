"""The experiment on real data: refused before it starts where git could not keep it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from pipeline.command import real
from pipeline.command.doctor import check_code_in_git
from pipeline.command.real import run_real
from pipeline.settings.profiles import profile_values
from pipeline.tracking.run import check_experiments, current_pipeline
from tests.described import REPOSITORY


@pytest.fixture(autouse=True)
def identity(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DVC_ROOT", "DVC_EXP_NAME"):
        monkeypatch.delenv(name, raising=False)
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "test")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "test@localhost")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with two commits, and the params of `make real`."""
    folder = tmp_path / "project"
    shutil.copytree(REPOSITORY / "profiles", folder / "profiles")
    (folder / "params.yaml").write_text("seed: 0\n")
    git(folder, "init", "--quiet")
    for message in ("start", "more"):
        git(folder, "add", "--all")
        git(folder, "commit", "--quiet", "--allow-empty", "-m", message)
    return folder


def git(folder: Path, *words: str) -> str:
    command = ["git", *words]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout


def refusal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """What `make real` says before it asks DVC for anything; doctor has to say the same."""
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(real, "_dvc", lambda _root, *words, **_how: asked.append(words))
    monkeypatch.setenv(real.VARIABLE, str(folder))
    before = (folder / "params.yaml").read_bytes()
    with pytest.raises(ValueError, match=r"`dvc exp`|git refuses") as refused:
        run_real(folder)
    assert asked == []
    assert (folder / "params.yaml").read_bytes() == before
    (finding,) = check_code_in_git(folder)
    assert (finding.level, finding.sentence) == ("error", str(refused.value))
    assert "\n" not in finding.sentence
    return finding.sentence


def test_a_whole_clone_is_fine(project: Path, tmp_path: Path) -> None:
    git(tmp_path, "clone", project.as_uri(), "whole")
    check_experiments(tmp_path / "whole")
    check_experiments(project / "profiles")  # git is asked, not one folder


@pytest.mark.parametrize("shallow", ["--depth=1", "--depth=2", "--shallow-exclude=old"])
def test_a_shallow_clone_is_told_what_to_fetch(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shallow: str
) -> None:
    git(project, "tag", "old", "HEAD~1")
    git(project, "commit", "--quiet", "--allow-empty", "-m", "third")
    git(tmp_path, "clone", shallow, project.as_uri(), "shallow")
    assert "`git fetch --unshallow`" in refusal(tmp_path / "shallow", monkeypatch)
    git(tmp_path / "shallow", "fetch", "--unshallow")
    check_experiments(tmp_path / "shallow")


def test_dvc_is_given_a_shell_that_can(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shells: list[str] = []

    def run(*_: object, env: dict[str, str], **_how: object) -> subprocess.CompletedProcess[bytes]:
        shells.append(env["SHELL"])
        return subprocess.CompletedProcess([], 1)

    monkeypatch.setenv("SHELL", "/usr/sbin/nologin")
    monkeypatch.setenv(real.VARIABLE, str(project))
    monkeypatch.setattr(real, "check_experiments", lambda _: None)
    monkeypatch.setattr("pipeline.command.real.subprocess.run", run)
    with pytest.raises(ValueError, match="`dvc exp run` failed"):
        run_real(project)
    assert set(shells) == {"/bin/sh"}


def test_dvc_runs_it_beside_a_workspace_that_keeps_its_params(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stage sees the profile, the experiment keeps it, and params.yaml is never another."""
    stage = "stages:\n  see:\n    cmd: cp params.yaml seen.txt && cp $THERE/params.yaml there.txt\n"
    params = "    params:\n    - profile\n    outs:\n"
    outs = "".join(f"    - {name}:\n        cache: false\n" for name in ("seen.txt", "there.txt"))
    (project / "dvc.yaml").write_text(stage + params + outs)
    mine = "# mine\nseed: 0\nprofile: mine\ndiffusion:\n  steps: 1\n"
    monkeypatch.setenv("THERE", str(project))
    subprocess.run(["dvc", "init", "--quiet"], cwd=project, check=True)
    git(project, "add", "--all")
    git(project, "commit", "--quiet", "-m", "a pipeline")
    (project / "params.yaml").write_text(mine)
    monkeypatch.setenv(real.VARIABLE, str(project))
    monkeypatch.setattr(real, "_fetch", lambda _: [])
    run_real(project)
    assert (project / "params.yaml").read_text() == mine
    kept = git(project, "for-each-ref", "--format=%(refname)", "refs/exps/*/*/real").strip()
    wanted = profile_values(REPOSITORY, "real")
    for acquire in wanted["acquire"].values():
        acquire["root"] = acquire["root"].replace(real.DEFAULT, str(project))
    for name in ("params.yaml", "seen.txt"):
        assert YAML(typ="safe").load(git(project, "show", f"{kept}:{name}")) == wanted
    assert git(project, "show", f"{kept}:there.txt") == mine


def test_a_project_that_is_in_no_repository_is_refused(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / ".git").rename(tmp_path / "elsewhere")
    assert "is not a git repository" in refusal(project, monkeypatch)


def test_a_repository_without_a_commit_is_refused(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / ".git").rename(tmp_path / "elsewhere")
    git(project, "init", "--quiet")
    assert "no commit yet" in refusal(project, monkeypatch)


def test_a_machine_without_git_is_told(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    assert "no git on PATH" in refusal(project, monkeypatch)


def test_a_commit_needs_somebody_to_make_it(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GIT_COMMITTER_EMAIL")
    assert "git has no user.email" in refusal(project, monkeypatch)
    git(project, "config", "user.email", "test@localhost")
    check_experiments(project)


def test_what_git_refuses_is_said_in_its_own_words(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    said = refusal(project, monkeypatch)
    assert "dubious ownership" in said
    assert "safe.directory" in said


def test_a_config_that_git_cannot_read_is_said_too(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (project / ".git" / "config").open("a") as file:
        file.write("[broken\n")
    assert "bad config line" in refusal(project, monkeypatch)


def test_a_journal_says_why_it_has_no_revision(
    project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(project)
    assert len(current_pipeline().revision) == 40
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    for _ in range(2):
        assert current_pipeline().revision == ""
    said = capsys.readouterr().err
    assert "dubious ownership" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("there", ["no repository", "no commit", "no git"])
def test_where_there_is_no_revision_to_know_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], there: str
) -> None:
    if there == "no commit":
        git(tmp_path, "init", "--quiet")
    if there == "no git":
        monkeypatch.setenv("PATH", os.devnull)
    assert current_pipeline().revision == ""
    assert capsys.readouterr().err == ""


REPORT = """\
import sys
from pathlib import Path

for name in sys.argv[2:]:
    Path("reports", name).parent.mkdir(exist_ok=True, parents=True)
    Path("reports", name).write_text(f"{sys.argv[1]} {name}")
"""
PIPELINE = """\
stages:
  report:
    cmd: {python} report.py {which} index.html tables/results.csv figures/errors.png summary.json
    outs: [reports/index.html, reports/tables, reports/figures]
    metrics: [reports/summary.json]
"""


def test_the_report_of_the_experiment_comes_out_of_the_cache(project: Path) -> None:
    def report(which: str) -> None:
        (project / "dvc.yaml").write_text(PIPELINE.format(python=sys.executable, which=which))
        subprocess.run([sys.executable, "-m", "dvc", "repro", "-q"], cwd=project, check=True)
        git(project, "add", "--all")
        git(project, "commit", "--quiet", "-m", which)

    (project / "report.py").write_text(REPORT)
    (project / ".gitignore").write_text("/reports\n/.dvc/cache\n/.dvc/tmp\n")
    subprocess.run([sys.executable, "-m", "dvc", "init", "-q"], cwd=project, check=True)
    report("real")
    git(project, "update-ref", "refs/exps/ab/cd0123/real", "HEAD")
    report("quick")
    old = project / "reports" / "real" / "figures" / "old.png"
    old.parent.mkdir(parents=True)
    old.write_text("no longer drawn")
    names = ["results.csv", "figures/errors.png", "index.html"]
    assert real._fetch(project) == [Path("reports", "real", name) for name in names]
    folder = project / "reports" / "real"
    assert (folder / "results.csv").read_text() == "real tables/results.csv"
    assert (folder / "figures" / "errors.png").read_text() == "real figures/errors.png"
    assert (folder / "index.html").read_text() == "real index.html"
    assert not old.exists()
    assert (project / "reports" / "index.html").read_text() == "quick index.html"
    git(project, "update-ref", "-d", "refs/exps/ab/cd0123/real")
    with pytest.raises(ValueError, match="DVC kept no experiment 'real'"):
        real._fetch(project)


COUNT = """\
import os, sys
from pathlib import Path

import torch

from pipeline.compute.checkpoints import open_checkpoint

with open_checkpoint({"stage": "count"}, [Path("seed.txt")]) as checkpoint:
    saved = checkpoint.load()
    done = saved[1]["done"] if saved else 0
    with Path(os.environ["THERE"], "started.txt").open("a") as file:
        file.write(f"{done} ")
    checkpoint.save({"weights": torch.ones(1)}, {"done": done + 5})
    if done == 0:
        os.kill(os.getpid(), 9)
    Path("count.txt").write_text(str(done + 5))
"""
COUNTING = """\
stages:
  count:
    cmd: {python} count.py
    deps: [seed.txt]
    params: [profile]
    outs: [count.txt]
"""


def test_a_training_that_was_cut_off_goes_on_when_the_experiment_is_run_again(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each run has a folder of its own; the checkpoints lie in the project."""
    (project / "count.py").write_text(COUNT)
    (project / "seed.txt").write_text("7")
    (project / "dvc.yaml").write_text(COUNTING.format(python=sys.executable))
    subprocess.run([sys.executable, "-m", "dvc", "init", "-q"], cwd=project, check=True)
    git(project, "add", "--all")
    git(project, "commit", "--quiet", "-m", "a pipeline")
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    monkeypatch.setenv("THERE", str(project))
    monkeypatch.setenv(real.VARIABLE, str(project))
    monkeypatch.setattr(real, "_fetch", lambda _: [])
    with pytest.raises(ValueError, match="`dvc exp run` failed"):
        run_real(project)
    assert len(list((project / ".pcrdiff" / "checkpoints").glob("*/latest.safetensors"))) == 1
    run_real(project)
    assert (project / "started.txt").read_text() == "0 5 "
    assert list((project / ".pcrdiff" / "checkpoints").glob("*")) == []
