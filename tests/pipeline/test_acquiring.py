"""A raw data set arrives whole, or what was there stays."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline import acquiring
from pipeline.acquiring import WRITERS, acquire
from pipeline.params import Acquire
from tests.tiny import files_below, write_boxes

TINY = {
    "modelnet40": {"train_per_category": 1, "test_per_category": 1},
    "3dmatch": {"scenes": 1, "fragments_per_scene": 1, "frames_per_fragment": 1},
    "kitti": {"sequences": 1, "scans_per_sequence": 1},
}


def section(family: str, source: str = "synthetic", root: str | None = None) -> Acquire:
    told: dict[str, Any] = {"family": family, "source": source, "root": root, "archives": []}
    return Acquire.model_validate(told | {"synthetic": TINY[family]})


def manifest(folder: Path) -> dict[str, Any]:
    read: dict[str, Any] = json.loads((folder / "manifest.json").read_text())
    return read


@pytest.mark.parametrize("family", WRITERS)
def test_a_made_up_data_set_is_the_same_twice_and_its_manifest_names_every_file(
    blank: Path, family: str
) -> None:
    contents = []
    for name in ("a", "b"):
        acquire(section(family), blank / name, seed=7)
        files = files_below(blank / name)
        contents.append({file: (blank / name / file).read_bytes() for file in files})
    assert contents[0] == contents[1]
    assert manifest(blank / "a")["source"] == "synthetic"
    named = [entry["path"] for entry in manifest(blank / "a")["files"]]
    assert sorted(["manifest.json", *named]) == files_below(blank / "a")


def test_another_seed_makes_another_data_set(blank: Path) -> None:
    for seed in (7, 8):
        acquire(section("kitti"), blank / str(seed), seed=seed)
    scan = "sequences/00/velodyne/000000.bin"
    assert (blank / "7" / scan).read_bytes() != (blank / "8" / scan).read_bytes()


def test_a_local_data_set_is_named_and_not_copied(blank: Path) -> None:
    acquire(section("modelnet40", "local", "boxes"), blank / "raw", seed=7)
    assert files_below(blank / "raw") == ["manifest.json"]
    assert manifest(blank / "raw")["root"] == "boxes"
    assert len(manifest(blank / "raw")["files"]) == 12


def test_a_relative_root_is_the_project_s_whatever_the_current_folder(
    blank: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (blank / "elsewhere").mkdir()
    monkeypatch.chdir(blank / "elsewhere")
    acquire(section("modelnet40", "local", "boxes"), blank / "raw", seed=7)
    assert len(manifest(blank / "raw")["files"]) == 12


def test_the_new_data_set_replaces_the_old_one_whole(blank: Path) -> None:
    write_boxes(blank / "raw")
    acquire(section("modelnet40", "local", "boxes"), blank / "raw", seed=7)
    assert files_below(blank / "raw") == ["manifest.json"]


def failing(error: BaseException) -> Callable[..., None]:
    def write(folder: Path, **_: object) -> None:
        folder.mkdir(parents=True)
        (folder / "half").write_text("")
        raise error

    return write


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_on_the_way_leaves_the_old_data_set_and_nothing_else(
    blank: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    acquire(section("modelnet40", "local", "boxes"), blank / "data" / "raw", seed=7)
    monkeypatch.setitem(acquiring.WRITERS, "kitti", failing(error))
    with pytest.raises(type(error)):
        acquire(section("kitti"), blank / "data" / "raw", seed=7)
    assert files_below(blank / "data") == ["raw/manifest.json"]


def test_the_remains_of_a_killed_run_do_not_end_in_the_data_set(blank: Path) -> None:
    write_boxes(blank / "data" / ".raw.partial")
    acquire(section("modelnet40", "local", "boxes"), blank / "data" / "raw", seed=7)
    assert files_below(blank / "data") == ["raw/manifest.json"]


def test_kitti_is_not_downloaded_and_the_sentence_says_what_to_do(blank: Path) -> None:
    with pytest.raises(ValueError, match="use `source: local` with that folder"):
        acquire(section("kitti", "download"), blank / "data" / "raw", seed=7)
    assert not (blank / "data" / "raw").exists()


def test_a_root_that_is_no_folder_is_named(blank: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere is not one"):
        acquire(section("kitti", "local", "nowhere"), blank / "data" / "raw", seed=7)
    assert not list(blank.glob("data/*"))
