"""How a stage ends."""

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.compute.stage import run


def ending(error: BaseException) -> object:
    """The exit code of a stage that raises."""

    def main() -> None:
        raise error

    with pytest.raises(SystemExit) as stop:
        run(main, __name__)
    return stop.value.code


def test_a_stage_that_does_its_work_ends_quietly(capsys: pytest.CaptureFixture[str]) -> None:
    done: list[int] = []
    run(lambda: done.append(1), "train")
    assert done == [1]
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    "error",
    [
        ValueError("a.h5 needs\n   schema 1"),
        FileNotFoundError("a.h5 needs schema 1"),
        RuntimeError("a.h5 needs schema 1"),
    ],
)
def test_what_a_user_can_mend_becomes_one_sentence(error: Exception) -> None:
    assert ending(error) == f"{__name__}: a.h5 needs schema 1"


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (MemoryError(), "the memory is too small"),
        (
            MemoryError("Unable to allocate\n8 TiB"),
            "the memory is too small: Unable to allocate 8 TiB",
        ),
        (OverflowError("int too large"), "a number is too large: int too large"),
        (RecursionError("maximum depth"), "something is nested too deeply: maximum depth"),
    ],
)
def test_what_is_too_large_becomes_one_sentence(error: Exception, expected: str) -> None:
    assert ending(error) == f"{__name__}: {expected}"


@pytest.mark.parametrize("quoted", ["x" * 10**7, "é\n" * 10**6])
def test_a_sentence_that_quotes_megabytes_keeps_its_beginning_and_its_end(quoted: str) -> None:
    said = str(ending(ValueError(f"params.yaml: a {quoted} is not in acquire")))
    assert said.startswith(f"{__name__}: params.yaml: a ")
    assert said.endswith("is not in acquire")
    assert len(said) < 2100


def test_a_disk_error_names_its_file() -> None:
    said = ending(OSError(28, "No space left on device", "out.h5"))
    assert said == f"{__name__}: [Errno 28] No space left on device: 'out.h5'"


def test_a_mistake_in_the_program_keeps_its_traceback() -> None:
    def main() -> None:
        raise AttributeError("no such thing")

    with pytest.raises(AttributeError):
        run(main, "train")


def test_the_process_ends_with_one_line_and_code_1(tmp_path: Path, repository: Path) -> None:
    script = tmp_path / "stage.py"
    script.write_text(
        "from pipeline.compute.stage import run\n"
        "def main():\n    raise ValueError('a.h5 needs\\nschema 1')\n"
        "run(main, 'train')\n"
    )
    environment = {"PYTHONPATH": str(repository)}
    done = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "train: a.h5 needs schema 1\n"
