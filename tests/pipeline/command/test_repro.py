"""Several stages at once do what `dvc repro` does."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.command.plan import plan_stages
from pipeline.command.repro import Finished, repro, timings
from pipeline.formats.yaml_files import read_yaml

pytestmark = pytest.mark.slow
DVC_YAML = """\
stages:
  make:
    cmd: cp params.yaml made
    params: [count]  # not `size`: DVC's run cache takes that for a file's
    outs: [made]
  use:
    foreach: [a, b, c]
    do:
      cmd: >-
        date +%s.%N > ../times/use-${item}.start; sleep 1.5; cp made used-${item};
        date +%s.%N > ../times/use-${item}.end
      deps: [made]
      outs: ["used-${item}"]
  quiet:
    cmd: >-
      date +%s.%N > ../times/quiet.start; sleep 0.3; cp made quiet; date +%s.%N > ../times/quiet.end
    deps: [made]
    meta: {alone: true}
    outs: [quiet]
  all:
    cmd: cat used-a used-b used-c quiet > all; cat dvc.lock > ../lock-seen
    deps: [used-a, used-b, used-c, quiet]
    outs: [all]
"""


def run(folder: Path, *words: str) -> str:
    done = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout


def lay_out(folder: Path) -> Path:
    """Write a project in which nothing has run."""
    project = folder / "project"
    project.mkdir()
    (folder / "times").mkdir()
    run(project, "git", "init", "--quiet")
    run(project, sys.executable, "-m", "dvc", "init", "--quiet")
    (project / "dvc.yaml").write_text(DVC_YAML)
    (project / "params.yaml").write_text("count: 1\n")
    return project


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return lay_out(tmp_path)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A project in which all has run, two stages at a time, and what was printed."""
    project = lay_out(tmp_path_factory.mktemp("finished"))
    return project, command(project, "-j", "2")


def command(project: Path, *words: str) -> str:
    """Run `pcrdiff repro` as a user does; give what it prints."""
    here = Path(__file__).parents[3]
    start = f"import sys; sys.path.insert(0, {str(here)!r}); from pipeline.command.cli import app; app()"
    return run(project, sys.executable, "-c", start, "repro", *words)


def go(project: Path, *targets: str) -> list[str]:
    """Run two stages at a time; give those that were run, in the order in which they ended."""
    return stages(command(project, "-j", "2", *targets))


def stages(printed: str) -> list[str]:
    return re.findall(r"^ +[\d.]+ s  (\S+)$", printed, re.MULTILINE)


def times(project: Path, name: str) -> tuple[float, float]:
    folder = project.parent / "times"
    start, end = (float((folder / f"{name}.{which}").read_text()) for which in ("start", "end"))
    return start, end


def overlap(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return a[0] < b[1] and b[0] < a[1]


def test_everything_runs_once_and_dvc_finds_nothing_left_to_do(finished: tuple[Path, str]) -> None:
    project, printed = finished
    ran = stages(printed)
    assert ran[0] == "make"
    assert ran[-1] == "all"
    assert sorted(ran) == ["all", "make", "quiet", "use@a", "use@b", "use@c"]
    assert "up to date" in run(project, sys.executable, "-m", "dvc", "status")


def test_what_each_group_took_is_told_at_the_end(finished: tuple[Path, str]) -> None:
    lines = finished[1].splitlines()
    groups = [line.split()[:2] for line in lines[-5:-1]]
    assert sorted(groups) == [["all", "1"], ["make", "1"], ["quiet", "1"], ["use", "3"]]
    assert re.fullmatch(r"6 stages in \d+ s", lines[-1])


def test_independent_stages_overlap_and_one_that_is_alone_does_not(
    finished: tuple[Path, str],
) -> None:
    project, _ = finished
    used = [times(project, f"use-{name}") for name in "abc"]
    assert any(overlap(one, other) for one in used for other in used if one is not other)
    assert not any(overlap(times(project, "quiet"), one) for one in used)


def test_the_last_stage_finds_the_others_in_the_lock(finished: tuple[Path, str]) -> None:
    seen = (finished[0].parent / "lock-seen").read_text()
    assert all(f"{name}:" in seen for name in ("make", "use@a", "use@b", "use@c", "quiet"))


def test_the_lock_says_what_dvc_alone_would_write(finished: tuple[Path, str]) -> None:
    project, _ = finished
    ours = read_yaml(project / "dvc.lock")
    (project / "dvc.lock").unlink()
    run(project, sys.executable, "-m", "dvc", "commit", "--force", "--quiet")
    assert read_yaml(project / "dvc.lock") == ours
    assert len(ours["stages"]) == 6


def test_a_stage_whose_inputs_are_written_again_as_they_were_is_not_run(project: Path) -> None:
    text = DVC_YAML.replace("cp params.yaml made", "echo same > made")
    (project / "dvc.yaml").write_text(text)
    assert sorted(go(project, "use@b")) == ["make", "use@b"]
    (project / "params.yaml").write_text("count: 2\n")
    assert [name for name, _ in plan_stages(project, ["use@b"])] == ["make", "use@b"]
    assert go(project, "use@b") == ["make"]
    assert go(project, "use@b") == []


def test_a_target_runs_with_what_it_needs_alone(project: Path) -> None:
    assert sorted(go(project, "use@b")) == ["make", "use@b"]
    assert sorted(go(project, "use")) == ["use@a", "use@c"]


def test_what_was_run_before_comes_from_dvcs_cache(project: Path) -> None:
    assert len(go(project)) == 6
    assert go(project) == []
    before = times(project, "quiet")
    (project / "params.yaml").write_text("count: 2\n")
    go(project)
    (project / "params.yaml").write_text("count: 1\n")
    second = times(project, "quiet")
    assert len(go(project)) == 6
    assert before != second == times(project, "quiet")
    assert (project / "all").read_text() == "count: 1\n" * 4


def test_a_failure_is_told_and_what_ran_beside_it_is_kept(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = DVC_YAML.replace("sleep 0.3; cp made quiet", "echo no room; false")
    (project / "dvc.yaml").write_text(text.replace("; date +%s.%N > ../times/quiet.end", ""))
    monkeypatch.chdir(project)
    with pytest.raises(ValueError, match=r"stage quiet failed(.|\n)*no room"):
        repro(project, [], jobs=2, tell=lambda _: None)
    with pytest.raises(subprocess.CalledProcessError) as failed:
        command(project, "-j", "2")
    assert failed.value.returncode == 1
    assert "no room" in failed.value.stderr
    lock = (project / "dvc.lock").read_text()
    assert "make:" in lock
    assert "all:" not in lock
    (project / "dvc.yaml").write_text(DVC_YAML)
    assert "make" not in go(project)


@pytest.mark.parametrize("shell", ["/bin/false", "/nowhere/tcsh"])
def test_whatever_shell_the_user_has_stages_run(
    project: Path, monkeypatch: pytest.MonkeyPatch, shell: str
) -> None:
    monkeypatch.setenv("SHELL", shell)
    assert sorted(go(project, "use@b")) == ["make", "use@b"]


def test_an_unknown_stage_is_one_sentence(project: Path) -> None:
    with pytest.raises(ValueError, match="no stage is called 'nonsense'"):
        repro(project, ["nonsense"], jobs=1, tell=lambda _: None)


def test_the_table_has_a_line_a_group_and_names_its_longest() -> None:
    lines = timings([Finished("a@x", 1.0, 0.5), Finished("a@y", 3.0, 2.0), Finished("b", 0.5, 0.1)])
    assert [line.split() for line in lines[1:]] == [
        ["a", "2", "4.0", "2.5", "3.0", "y"],
        ["b", "1", "0.5", "0.1", "0.5"],
    ]
    assert timings([]) == []


LOCAL = """\
stages:
  acquire:
    foreach: [boxes]
    do:
      cmd: >-
        {python} -c "from pathlib import Path;
        from pcrdiff.datasets.manifest import write_manifest as write;
        write(Path('../boxes'), Path('raw'), source='local')"
      outs:
      - raw:
          persist: true
  use:
    cmd: cp raw/manifest.json used
    deps: [raw]
    outs: [used]
"""


def test_a_local_data_set_that_changed_is_acquired_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    project, boxes = lay_out(tmp_path), tmp_path / "boxes"
    (project / "dvc.yaml").write_text(LOCAL.format(python=sys.executable))
    boxes.mkdir()
    for name in ("a", "b"):
        (boxes / name).write_text("one")
    assert go(project) == ["acquire@boxes", "use"]
    (boxes / "a").touch()
    assert list(plan_stages(project, [])) == []
    changes: list[Callable[[], object]] = [
        lambda: (boxes / "a").write_text("two"),
        lambda: (boxes / "c").write_text("two"),
    ]
    for change in changes:
        change()
        assert dict(plan_stages(project, []))["acquire@boxes"] == "its local files changed"
        assert go(project) == ["acquire@boxes", "use"]
        assert (project / "used").read_bytes() == (project / "raw/manifest.json").read_bytes()
    assert list(plan_stages(project, [])) == []
