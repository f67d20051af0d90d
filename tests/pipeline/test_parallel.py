"""Several stages at once do what `dvc repro` does."""

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.parallel import Finished, repro, timings

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
        date +%s.%N > ../times/use-${item}.start; sleep 0.5; cp made used-${item};
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


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "project"
    folder.mkdir()
    (tmp_path / "times").mkdir()
    run(folder, "git", "init", "--quiet")
    run(folder, sys.executable, "-m", "dvc", "init", "--quiet")
    (folder / "dvc.yaml").write_text(DVC_YAML)
    (folder / "params.yaml").write_text("count: 1\n")
    return folder


def go(project: Path, *targets: str, jobs: int = 2) -> list[str]:
    """Run in a process of its own, as the command does; give the stages it ran."""
    code = (
        "import sys; from pathlib import Path; from pipeline.parallel import repro\n"
        f"for e in repro(Path.cwd(), sys.argv[1:], jobs={jobs}, tell=lambda e: None): print(e.stage)"
    )
    here = Path(__file__).parents[2]
    words = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(here)!r})\n{code}"]
    return run(project, *words, *targets).split()


def times(project: Path, name: str) -> tuple[float, float]:
    folder = project.parent / "times"
    start, end = (float((folder / f"{name}.{which}").read_text()) for which in ("start", "end"))
    return start, end


def overlap(a: tuple[float, float], b: tuple[float, float]) -> bool:
    return a[0] < b[1] and b[0] < a[1]


def test_everything_runs_once_and_dvc_finds_nothing_left_to_do(project: Path) -> None:
    ran = go(project)
    assert ran[0] == "make"
    assert ran[-1] == "all"
    assert sorted(ran) == ["all", "make", "quiet", "use@a", "use@b", "use@c"]
    assert "up to date" in run(project, sys.executable, "-m", "dvc", "status")
    assert go(project) == []


def test_independent_stages_overlap_and_one_that_is_alone_does_not(project: Path) -> None:
    go(project)
    used = [times(project, f"use-{name}") for name in "abc"]
    assert any(overlap(one, other) for one in used for other in used if one is not other)
    assert not any(overlap(times(project, "quiet"), one) for one in used)


def test_the_lock_is_the_one_dvc_writes_whoever_ended_first(project: Path) -> None:
    go(project)
    ours = (project / "dvc.lock").read_text()
    (project / "dvc.lock").unlink()
    run(project, sys.executable, "-m", "dvc", "repro", "--quiet", "--force")
    assert (project / "dvc.lock").read_text() == ours


def test_the_last_stage_finds_the_others_in_the_lock(project: Path) -> None:
    go(project)
    seen = (project.parent / "lock-seen").read_text()
    assert all(f"{name}:" in seen for name in ("make", "use@a", "use@b", "use@c", "quiet"))


def test_a_target_runs_with_what_it_needs_alone(project: Path) -> None:
    assert sorted(go(project, "use@b")) == ["make", "use@b"]
    assert sorted(go(project, "use")) == ["use@a", "use@c"]


def test_what_was_run_before_comes_from_dvcs_cache(project: Path) -> None:
    go(project)
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
    lock = (project / "dvc.lock").read_text()
    assert "make:" in lock
    assert "all:" not in lock
    (project / "dvc.yaml").write_text(DVC_YAML)
    assert "make" not in go(project)


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
