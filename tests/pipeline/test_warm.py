"""A command in a fork does what it does in a new process."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.warm import stage_words
from tests.pipeline.test_parallel import command, run

DVC_YAML = """\
stages:
  warm:
    foreach: [a, b]
    do:
      cmd: env "PATH=$DVC_ROOT/.venv/bin:$PATH" python -m stages.tell --out told-${item}
      params: [fail]
      outs: ["told-${item}"]
  cold:
    cmd: env "PATH=$DVC_ROOT/.venv/bin:$PATH" python -m stages.tell --out told-cold
    meta: {alone: true}
    outs: [told-cold]
"""
TELL = """\
import json, os, sys
from pathlib import Path
from ruamel.yaml import YAML
import stages.words

loaded = "torch" in sys.modules
if YAML(typ="safe").load(Path("params.yaml"))["fail"]:
    sys.exit("tell: it was told to fail")
told = {
    "argv": sys.argv[1:], "stage": os.environ["DVC_STAGE"], "folder": os.getcwd(),
    "name": __name__, "package": __package__, "word": stages.words.WORD, "loaded": loaded,
    "others": [name for name in sys.modules if name.partition(".")[0] in ("pipeline", "dvc")],
}
Path(sys.argv[2]).write_text(json.dumps(told))
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with a stage of its own."""
    project = tmp_path / "project"
    (project / "stages").mkdir(parents=True)
    run(project, "git", "init", "--quiet")
    run(project, sys.executable, "-m", "dvc", "init", "--quiet")
    (project / "dvc.yaml").write_text(DVC_YAML)
    (project / "params.yaml").write_text("fail: 0\n")
    (project / "stages" / "__init__.py").touch()
    (project / "stages" / "tell.py").write_text(TELL)
    (project / "stages" / "words.py").write_text("WORD = 1\n")
    return project


def told(project: Path, name: str) -> dict[str, object]:
    content: dict[str, object] = json.loads((project / f"told-{name}").read_text())
    return content


@pytest.mark.slow
def test_a_fork_is_told_what_a_new_process_is(project: Path) -> None:
    command(project, "-j", "2")
    warm, cold = told(project, "a"), told(project, "cold")
    assert (warm.pop("loaded"), cold.pop("loaded")) == (True, False)
    assert (warm.pop("stage"), cold.pop("stage")) == ("warm@a", "cold")
    assert (warm.pop("argv"), cold.pop("argv")) == (["--out", "told-a"], ["--out", "told-cold"])
    assert "pipeline.warm" not in warm.pop("others")  # type: ignore[operator]
    assert cold.pop("others") == []
    assert warm == cold
    assert warm["folder"] == str(project)


@pytest.mark.slow
def test_the_projects_code_is_read_when_the_stage_runs(project: Path) -> None:
    command(project, "-j", "1", "warm@a")
    (project / "stages" / "words.py").write_text("WORD = 22\n")
    (project / "told-b").unlink(missing_ok=True)
    command(project, "-j", "1", "warm@b")
    assert (told(project, "a")["word"], told(project, "b")["word"]) == (1, 22)


@pytest.mark.slow
def test_a_stage_that_fails_in_a_fork_fails_with_its_sentence(project: Path) -> None:
    (project / "params.yaml").write_text("fail: 1\n")
    with pytest.raises(subprocess.CalledProcessError) as failed:
        command(project, "-j", "1", "warm@a")
    assert failed.value.returncode == 1
    assert "tell: it was told to fail" in failed.value.stderr
    assert not os.path.lexists(project / "told-a")


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("python -m stages.train --a b", ["stages.train", "--a", "b"]),
        ('env "PATH=$DVC_ROOT/.venv/bin:$PATH" python -m stages.time', ["stages.time"]),
        ('env "PATH=/elsewhere:$PATH" python -m stages.time', None),
        ("env python -m stages.time", None),
        ("python -m stages.train --method it's", None),
        ("cp a b", None),
        ("python -m other.train", None),
        ("python -m", None),
        ("python -m stages.train; rm x", None),
        ("python -m stages.train --out $HOME/x", None),
        ("A=1 python -m stages.train", None),
        ("", None),
    ],
)
def test_only_a_single_stage_of_ours_is_run_in_a_fork(
    written: str, words: list[str] | None
) -> None:
    assert stage_words(written) == words
