"""The time stage, end to end."""

import csv
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.settings.params import read_params
from stages.time import COLUMNS
from tests.tiny import CF, PAIRS, files_below, instance, refusal


@pytest.mark.parametrize(
    ("method", "settings"),
    [(CF, ["paper"]), ("rpmnet", ["paper", "official"]), ("icp", ["paper", "official"])],
)
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


@pytest.mark.slow
def test_a_process_of_its_own_times_every_method(project: Path) -> None:
    shutil.rmtree(project / "results/times")
    command = [sys.executable, "-m", "stages", "time", *instance("time").argv]
    subprocess.run(command, check=True, timeout=300)
    params = read_params()
    timed = [*params.run.classical, *params.run.diffused, *params.run.baselines]
    assert files_below(project / "results/times") == sorted(
        f"{name}.csv" for name in [*timed, "starts"]
    )


def test_a_pair_file_that_was_cut_is_refused_and_nothing_is_written(project: Path) -> None:
    (project / PAIRS).write_bytes((project / PAIRS).read_bytes()[:200])
    (project / "results/times/icp.csv").unlink()
    said = refusal("time", instance("time").argv)
    assert f"{PAIRS} is not a pair file" in said
    assert not (project / "results/times/icp.csv").exists()
