"""The files of `make bench`: written and read back, and what is refused."""

from pathlib import Path

import pytest

from pipeline.formats.benchmarks import Benchmarks, read_benchmarks, write_benchmarks
from tests.pipeline.reporting.synthetic_benchmarks import make_benchmarks


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    found = make_benchmarks()
    write_benchmarks(tmp_path, found)
    assert read_benchmarks(tmp_path) == found
    files = (file for file in tmp_path.rglob("*") if file.is_file())
    assert sorted(file.relative_to(tmp_path).as_posix() for file in files) == [
        "details/ceilings.csv",
        "details/latency.csv",
        "details/memory.csv",
        "speed.csv",
    ]


def test_where_nothing_was_measured_nothing_is_read(tmp_path: Path) -> None:
    assert read_benchmarks(tmp_path) is None
    assert read_benchmarks(tmp_path / "nowhere") is None


def test_ratios_alone_are_enough(tmp_path: Path) -> None:
    found = make_benchmarks()
    write_benchmarks(tmp_path, found)
    for name in ("latency", "memory", "ceilings"):
        (tmp_path / "details" / f"{name}.csv").unlink()
    assert read_benchmarks(tmp_path) == Benchmarks(found.ratios, [], [], [])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ratio,ours", "ours,ratio", "needs the columns"),
        ("cf_train_step_vs_plain,6", "cf_train_step_vs_plain,six", "holds what is no number"),
    ],
)
def test_another_format_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    write_benchmarks(tmp_path, make_benchmarks())
    file = tmp_path / "speed.csv"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=said):
        read_benchmarks(tmp_path)
