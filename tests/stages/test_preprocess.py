"""The preprocess stage, end to end."""

import json
from pathlib import Path

import pytest

from pcrdiff.registration import SPLITS
from pipeline.formats.pairs import read_attributes, read_pairs
from tests.tiny import (
    PAIRS,
    SCENARIO,
    files_below,
    instance,
    run_instance,
    tiny_params,
    write_params,
)


def test_writes_a_pair_file_that_is_read(project: Path) -> None:
    (project / PAIRS).unlink()
    run_instance(instance(f"preprocess@{SCENARIO}"))
    assert files_below(project / "data" / "pairs") == [PAIRS.name]
    assert [len(read_pairs(PAIRS, split)) for split in SPLITS] == [6, 3, 3]
    assert read_attributes(PAIRS)["provenance"]["dataset"] == "modelnet40"


def test_writes_the_same_bytes_twice(project: Path) -> None:
    before = (project / PAIRS).read_bytes()
    (project / PAIRS).unlink()
    run_instance(instance(f"preprocess@{SCENARIO}"))
    assert (project / PAIRS).read_bytes() == before


def test_writes_the_same_bytes_in_a_folder_of_another_name(project: Path, blank: Path) -> None:
    assert Path.cwd() == blank
    run_instance(instance("acquire@modelnet40"))
    run_instance(instance(f"preprocess@{SCENARIO}"))
    assert (blank / PAIRS).read_bytes() == (project / PAIRS).read_bytes()


@pytest.mark.usefixtures("blank")
def test_the_journal_tells_how_many_pairs_there_are() -> None:
    run_instance(instance("acquire@modelnet40"))
    run_instance(instance(f"preprocess@{SCENARIO}"))
    journals = Path(".pcrdiff/journal").glob("*/journal.jsonl")
    events = [json.loads(line) for path in journals for line in path.read_text().splitlines()]
    (metrics,) = [event["values"] for event in events if event["event"] == "metrics"]
    assert metrics == {"train_pairs": 6, "val_pairs": 3, "test_pairs": 3}


@pytest.mark.usefixtures("blank")
def test_what_was_dropped_is_in_the_journal_by_count_and_in_the_pair_file_by_name() -> None:
    params = tiny_params()
    params["scenarios"][SCENARIO]["degenerate"] = "drop"
    write_params(params)
    line = "\n".join(f"{k / 10} {k / 5} {3 * k / 10}" for k in (1, 2, 3))
    (flat,) = Path("boxes").rglob("sofa_0004.off")
    flat.write_text(f"OFF\n3 1 0\n{line}\n3 0 1 2\n")
    run_instance(instance("acquire@modelnet40"))
    run_instance(instance(f"preprocess@{SCENARIO}"))
    journals = Path(".pcrdiff/journal").glob("*/journal.jsonl")
    events = [json.loads(line) for path in journals for line in path.read_text().splitlines()]
    (metrics,) = [event["values"] for event in events if event["event"] == "metrics"]
    assert metrics == {"train_pairs": 6, "val_pairs": 3, "test_pairs": 2, "test_dropped": 1}
    assert read_attributes(PAIRS)["provenance"]["dropped_as_degenerate"] == {"test": ["sofa_0004"]}
    assert len(read_pairs(PAIRS, "test")) == 2
