"""The plan names what would run, and why; nothing is run for it."""

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.command.plan import plan_stages

DVC_YAML = """\
stages:
  make:
    cmd: cp params.yaml made
    params: [size]
    outs: [made]
  use:
    cmd: cp made used
    deps: [made]
    outs: [used]
  other:
    cmd: echo other > other
    outs: [other]
"""


def run(folder: Path, *words: str) -> None:
    subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    run(tmp_path, "git", "init", "--quiet")
    run(tmp_path, sys.executable, "-m", "dvc", "init", "--quiet")
    (tmp_path / "dvc.yaml").write_text(DVC_YAML)
    (tmp_path / "params.yaml").write_text("size: 1\n")
    return tmp_path


@pytest.mark.slow
def test_all_runs_at_first_then_nothing_then_what_a_change_reaches(project: Path) -> None:
    first = dict(plan_stages(project, []))
    assert list(first) == ["make", "use", "other"]
    assert first["use"] == "make runs"
    assert not (project / "made").exists()
    assert [name for name, _ in plan_stages(project, ["other"])] == ["other"]
    run(project, sys.executable, "-m", "dvc", "repro", "--quiet")
    assert list(plan_stages(project, [])) == []
    (project / "params.yaml").write_text("size: 2\n")
    assert list(plan_stages(project, [])) == [
        ("make", "size is modified"),
        ("use", "make runs"),
    ]


def test_an_unknown_stage_is_one_sentence(project: Path) -> None:
    with pytest.raises(ValueError, match="nonsense"):
        list(plan_stages(project, ["nonsense"]))
