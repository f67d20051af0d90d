"""The experiment on real data: refused before it starts where git could not keep it."""

import os
import subprocess
from pathlib import Path

import pytest

from pipeline import real
from pipeline.doctor import check_code_in_git
from pipeline.invocation import check_experiments, current_pipeline
from pipeline.real import run_real


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
    (folder / "profiles").mkdir(parents=True)
    (folder / "profiles" / "real.yaml").write_text("acquire: {}\n")
    (folder / "params.yaml").write_text("seed: 0\n")
    git(folder, "init", "--quiet")
    for message in ("start", "more"):
        git(folder, "add", "--all")
        git(folder, "commit", "--quiet", "--allow-empty", "-m", message)
    return folder


def git(folder: Path, *words: str) -> None:
    subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True)


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
    monkeypatch.setattr("pipeline.real.subprocess.run", run)
    with pytest.raises(ValueError, match="`dvc exp run` failed"):
        run_real(project)
    assert set(shells) == {"/bin/sh"}


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
