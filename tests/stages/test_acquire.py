"""The acquire stage, end to end."""

import json
from pathlib import Path

import pytest

from stages.acquire import main
from tests.tiny import files_below, instance, refusal, run_instance, tiny_params, write_params


@pytest.mark.parametrize("dataset", ["modelnet40", "3dmatch", "kitti"])
def test_writes_the_folder_that_dvc_yaml_names_and_nothing_beside_it(
    blank: Path, dataset: str
) -> None:
    run_instance(instance(f"acquire@{dataset}"))
    files = files_below(blank / "data")
    assert f"raw/{dataset}/manifest.json" in files
    assert all(file.startswith(f"raw/{dataset}/") for file in files)
    assert not any(part.startswith(".") for file in files for part in Path(file).parts)


def test_the_same_params_write_the_same_bytes(blank: Path) -> None:
    contents = []
    for _ in range(2):
        run_instance(instance("acquire@3dmatch"))
        files = files_below(blank / "data")
        contents.append({file: (blank / "data" / file).read_bytes() for file in files})
    assert contents[0] == contents[1]


def test_the_journal_tells_what_was_acquired(blank: Path) -> None:
    run_instance(instance("acquire@modelnet40"))
    (events,) = blank.glob(".pcrdiff/journal/*/journal.jsonl")
    start, *_, end = map(json.loads, events.read_text().splitlines())
    assert start["params"] == {"dataset": "modelnet40", "source": "local"}
    assert end["status"] == "FINISHED"


def test_an_empty_folder_is_refused(blank: Path) -> None:
    (blank / "empty").mkdir()
    params = tiny_params()
    params["acquire"]["modelnet40"]["root"] = "empty"
    write_params(params)
    said = refusal("acquire", ["--dataset", "modelnet40", "--out", "data/raw/modelnet40"])
    assert "needs at least one file, empty holds none" in said
    assert not list(blank.glob("data/raw/*"))


def test_params_that_are_not_there_are_named(blank: Path) -> None:
    (blank / "params.yaml").unlink()
    said = refusal("acquire", ["--dataset", "modelnet40", "--out", "data/raw/modelnet40"])
    assert "params.yaml" in said


def test_a_flag_that_is_missing_ends_with_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--dataset", "kitti"])
    assert stop.value.code == 2
    assert "--out" in capsys.readouterr().err
