"""The bar changes nothing of what is looped over."""

import pytest

from pcrdiff.loops import Progress
from pipeline.compute.progress import bar


def test_gives_every_item_in_its_order(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(bar(["a", "b", "c"], "letters")) == ["a", "b", "c"]
    assert "letters: 100%" in capsys.readouterr().err


def test_says_nothing_on_stdout_and_little_in_a_log(capsys: pytest.CaptureFixture[str]) -> None:
    assert sum(bar(range(1000), "numbers")) == 499500
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\r") <= 3  # the start and the end; a line every ten seconds between


def test_is_what_the_library_takes() -> None:
    assert isinstance(bar, Progress)


def test_an_empty_loop_is_fine() -> None:
    assert list(bar([], "nothing")) == []
