"""The time stage, end to end."""

import csv
from pathlib import Path

import pytest

from pipeline.timing import COLUMNS
from tests.tiny import CF, PAIRS, instance, refusal


@pytest.mark.parametrize(("method", "settings"), [(CF, ["paper"]), ("icp", ["paper", "official"])])
def test_writes_what_each_of_the_first_pairs_took_in_each_setting(
    project: Path, method: str, settings: list[str]
) -> None:
    text = (project / f"results/times/{method}.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    assert tuple(rows[0]) == COLUMNS
    assert [(row["setting"], row["pair"]) for row in rows] == [
        (setting, str(pair)) for setting in settings for pair in range(2)
    ]
    assert all(0 < float(row["seconds"]) < 60 for row in rows)
    assert all(0 <= float(row["peak_memory_mib"]) < 4096 for row in rows)


def test_a_pair_file_that_was_cut_is_refused_and_nothing_is_written(project: Path) -> None:
    (project / PAIRS).write_bytes((project / PAIRS).read_bytes()[:200])
    (project / "results/times/icp.csv").unlink()
    said = refusal("time", instance("time_classical@icp").argv)
    assert f"{PAIRS} is not a pair file" in said
    assert not (project / "results/times/icp.csv").exists()
