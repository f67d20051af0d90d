"""A raw data set arrives whole, or what was there stays."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pipeline.settings.params import Acquire
from stages.acquire import WRITERS, acquire
from tests.described import REPOSITORY
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
    acquire(section("kitti"), blank / "data" / "raw", seed=7)
    acquire(section("modelnet40", "local", "boxes"), blank / "data" / "raw", seed=7)
    assert files_below(blank / "data") == ["raw/manifest.json"]
    acquire(section("kitti"), blank / "data" / "raw", seed=7)
    assert len(files_below(blank / "data" / "raw")) == 1 + len(
        manifest(blank / "data/raw")["files"]
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in files_below(folder)}


@pytest.mark.parametrize("root", [".", "data", "data/raw", "data/raw/bed", "data/.raw.partial"])
@pytest.mark.parametrize("absolute", [True, False])
def test_a_local_data_set_is_not_replaced_by_its_own_manifest(
    blank: Path, monkeypatch: pytest.MonkeyPatch, root: str, absolute: bool
) -> None:
    write_boxes(blank / "data" / "raw")
    write_boxes(blank / "data" / ".raw.partial")
    before = contents(blank)
    (blank / "elsewhere").mkdir()
    monkeypatch.chdir(blank / "elsewhere")
    told = str(blank / root) if absolute else root
    with pytest.raises(ValueError, match="needs a folder apart from") as refusal:
        acquire(section("modelnet40", "local", told), blank / "data" / "raw", seed=7)
    assert f"got root {told}:" in str(refusal.value)
    assert contents(blank) == before


def test_a_link_on_the_way_does_not_hide_that_root_and_output_are_one(blank: Path) -> None:
    write_boxes(blank / "data" / "raw")
    (blank / "link").symlink_to(blank / "data")
    before = contents(blank / "data")
    for root, out in (("link/raw", "data/raw"), ("data/raw", "link/raw")):
        with pytest.raises(ValueError, match="needs a folder apart from"):
            acquire(section("modelnet40", "local", root), blank / out, seed=7)
    assert contents(blank / "data") == before


def test_a_temporary_workspace_does_not_take_the_place_of_the_project_s_own_data_set(
    blank: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_boxes(blank / "data" / "raw")
    (blank / "temporary").mkdir()
    monkeypatch.chdir(blank / "temporary")
    with pytest.raises(ValueError, match="needs a folder apart from data/raw"):
        acquire(section("modelnet40", "local", "data/raw"), Path("data/raw"), seed=7)


@pytest.mark.parametrize("source", ["synthetic", "local"])
def test_an_experiment_in_another_folder_acquires_there(
    blank: Path, monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    """DVC_ROOT stays the project's, where nothing is written; a local root is the project's."""
    (blank / "temporary").mkdir()
    monkeypatch.chdir(blank / "temporary")
    acquire(section("modelnet40", source, "boxes"), Path("data/raw"), seed=7)
    assert (blank / "temporary" / "data" / "raw" / "manifest.json").is_file()
    assert not (blank / "data").exists()


@pytest.mark.parametrize("source", ["synthetic", "local"])
def test_a_folder_that_acquire_did_not_make_stays(blank: Path, source: str) -> None:
    write_boxes(blank / "data" / "raw")
    before = contents(blank / "data")
    with pytest.raises(FileExistsError, match=r"holds files and no manifest\.json"):
        acquire(section("modelnet40", source, "boxes"), blank / "data" / "raw", seed=7)
    assert contents(blank / "data") == before


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"files": [1]}'])
def test_a_manifest_of_someone_else_s_does_not_make_a_folder_ours(blank: Path, text: str) -> None:
    write_boxes(blank / "data" / "raw")
    (blank / "data" / "raw" / "manifest.json").write_text(text)
    before = contents(blank / "data")
    with pytest.raises(FileExistsError, match=r"no manifest\.json of an acquire stage"):
        acquire(section("kitti"), blank / "data" / "raw", seed=7)
    assert contents(blank / "data") == before


@pytest.mark.parametrize("source", ["synthetic", "local"])
def test_a_file_laid_into_a_folder_of_ours_stays(blank: Path, source: str) -> None:
    out = blank / "data" / "raw"
    acquire(section("modelnet40", source, "boxes"), out, seed=7)
    (out / "mine.txt").write_text("mine")
    before = contents(blank / "data")
    with pytest.raises(FileExistsError, match=r"raw/mine\.txt is not from an acquire stage"):
        acquire(section("kitti"), out, seed=7)
    assert contents(blank / "data") == before


def test_a_file_of_ours_that_was_replaced_by_one_as_long_stays(blank: Path) -> None:
    out = blank / "data" / "raw"
    acquire(section("kitti"), out, seed=7)
    scan = out / "sequences/00/velodyne/000000.bin"
    scan.write_bytes(bytes(scan.stat().st_size))
    with pytest.raises(FileExistsError, match=r"000000\.bin is not from an acquire stage"):
        acquire(section("kitti"), out, seed=8)
    assert not any(scan.read_bytes())


def test_a_link_and_what_it_leads_to_stay(blank: Path) -> None:
    out = blank / "data" / "raw"
    out.parent.mkdir()
    acquire(section("kitti"), blank / "ours", seed=7)
    for goal in ("boxes", "ours", "nowhere"):
        out.symlink_to(blank / goal)
        before = contents(blank)
        with pytest.raises(FileExistsError, match="a link is there"):
            acquire(section("kitti"), out, seed=7)
        assert out.is_symlink()
        assert contents(blank) == before
        out.unlink()


def test_a_file_in_the_place_of_the_data_set_stays(blank: Path) -> None:
    (blank / "raw").write_text("notes")
    with pytest.raises(FileExistsError, match="a file is there"):
        acquire(section("kitti"), blank / "raw", seed=7)
    assert (blank / "raw").read_text() == "notes"


@pytest.mark.parametrize("state", ["partial", "retired"])
def test_a_link_in_the_place_of_something_half_made_is_not_followed(
    blank: Path, state: str
) -> None:
    before = contents(blank / "boxes")
    (blank / f".raw.{state}").symlink_to(blank / "boxes")
    acquire(section("kitti"), blank / "raw", seed=7)
    assert contents(blank / "boxes") == before
    assert [path.name for path in blank.glob(".raw.*")] == []


def test_an_empty_folder_is_in_nobody_s_way(blank: Path) -> None:
    (blank / "raw").mkdir()
    acquire(section("kitti"), blank / "raw", seed=7)
    assert manifest(blank / "raw")["source"] == "synthetic"


@pytest.fixture
def versioned(blank: Path) -> Path:
    """A project with a history, in which every data set was acquired once, as dvc.lock says."""
    for name in ("dvc.yaml", "dvc.lock", ".gitignore"):
        shutil.copy(REPOSITORY / name, blank)
    git = ("git", "-c", "user.name=Me", "-c", "user.email=me@here")
    subprocess.run([*git, "init", "-q"], cwd=blank, check=True)
    assert dvc(blank, "init", "-q").returncode == 0
    subprocess.run([*git, "add", "-A"], cwd=blank, check=True)
    subprocess.run([*git, "commit", "-q", "-m", "all"], cwd=blank, check=True)
    return blank


def dvc(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    told = {name: value for name, value in os.environ.items() if not name.startswith("DVC_")}
    command = [sys.executable, "-m", "dvc", *words]
    return subprocess.run(
        command, cwd=folder, env=told | {"SHELL": "/bin/sh"}, capture_output=True, text=True
    )


@pytest.mark.parametrize(
    ("command", "lies_as"), [("repro", "folder"), ("repro", "link"), ("exp run", "folder")]
)
def test_dvc_removes_no_data_set_before_acquire_can_refuse(
    versioned: Path, command: str, lies_as: str
) -> None:
    out = versioned / "data" / "raw" / "kitti"
    mine = out if lies_as == "folder" else versioned / "mine"
    write_boxes(mine)
    if lies_as == "link":
        out.parent.mkdir(parents=True)
        out.symlink_to(mine)
    before = contents(mine)
    done = dvc(versioned, *command.split(), "-s", "acquire@kitti")
    assert done.returncode != 0
    assert "acquire needs data/raw/kitti for itself" in done.stderr
    assert contents(mine) == before
    assert out.is_symlink() == (lies_as == "link")


def test_dvc_puts_no_data_set_of_its_cache_in_the_place_of_a_user_s_own(versioned: Path) -> None:
    out = versioned / "data" / "raw" / "kitti"
    write_boxes(out)
    before = contents(out)
    dvc(versioned, "checkout", "--force")  # it complains of the other outputs, which nobody made
    assert contents(out) == before


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
    monkeypatch.setitem(WRITERS, "kitti", failing(error))
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
