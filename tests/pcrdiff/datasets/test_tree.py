"""Folders are listed whole, once each, or the sentence names what cannot be listed."""

import errno
import os
from pathlib import Path

import pytest

from pcrdiff.datasets.listing import entries, walk_files

ERRORS = [
    PermissionError(errno.EACCES, "Permission denied"),
    OSError(errno.EIO, "Input/output error"),
    OSError(errno.ESTALE, "Stale file handle"),
    FileNotFoundError(errno.ENOENT, "No such file or directory"),
]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in ("b/2.off", "b/1.off", "a/deep/3.off", "c.txt"):
        path = tmp_path / "root" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    (tmp_path / "root" / "empty").mkdir()
    return tmp_path / "root"


def names(root: Path) -> list[str]:
    return sorted(path.relative_to(root).as_posix() for path in walk_files(root))


def fail_at(folder: Path, error: OSError, patch: pytest.MonkeyPatch) -> None:
    """Make one folder as one that cannot be listed: root may list any."""
    iterdir = Path.iterdir

    def refuse(path: Path) -> object:
        if path == folder:
            raise error
        return iterdir(path)

    patch.setattr(Path, "iterdir", refuse)


def test_entries_are_sorted(root: Path) -> None:
    assert [path.name for path in entries(root)] == ["a", "b", "c.txt", "empty"]
    assert entries(root / "empty") == []


def test_every_file_is_listed_once_and_folders_are_not(root: Path) -> None:
    assert names(root) == ["a/deep/3.off", "b/1.off", "b/2.off", "c.txt"]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__ + str(error.errno))
@pytest.mark.parametrize("place", [".", "b", "a/deep", "empty"])
def test_a_folder_that_cannot_be_listed_is_named(
    root: Path, monkeypatch: pytest.MonkeyPatch, error: OSError, place: str
) -> None:
    fail_at(root / place, error, monkeypatch)
    with pytest.raises(type(error)) as refusal:
        names(root)
    assert str(refusal.value) == f"{root / place} cannot be listed: {error.strerror}"


def test_an_error_without_a_reason_of_the_system_is_named_too(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail_at(root, OSError("unheard of"), monkeypatch)
    with pytest.raises(OSError, match="root cannot be listed: unheard of"):
        entries(root)


def test_what_is_no_folder_cannot_be_listed(root: Path) -> None:
    with pytest.raises(NotADirectoryError, match=r"c\.txt cannot be listed"):
        entries(root / "c.txt")
    with pytest.raises(FileNotFoundError, match="gone"):
        names(root / "gone")


@pytest.mark.parametrize("goal", [".", "..", "../.."])
def test_a_link_upwards_is_walked_once(root: Path, goal: str) -> None:
    (root / "a" / "up").symlink_to(root / "a" / goal, target_is_directory=True)
    found = [path.resolve() for path in walk_files(root)]
    assert len(found) == len(set(found))
    assert {path.relative_to(root.resolve()).as_posix() for path in found} >= {
        "a/deep/3.off",
        "b/1.off",
        "b/2.off",
        "c.txt",
    }


def test_two_folders_that_link_to_each_other_are_walked_once(root: Path) -> None:
    (root / "a" / "to_b").symlink_to(root / "b")
    (root / "b" / "to_a").symlink_to(root / "a")
    assert len(names(root)) == 4


def test_a_folder_elsewhere_is_followed_and_a_link_to_nothing_or_itself_is_no_file(
    root: Path, tmp_path: Path
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "4.off").write_text("")
    (root / "linked").symlink_to(tmp_path / "elsewhere")
    (root / "dangling").symlink_to(tmp_path / "nowhere")
    (root / "itself").symlink_to(root / "itself")
    assert names(root) == ["a/deep/3.off", "b/1.off", "b/2.off", "c.txt", "linked/4.off"]


def test_a_file_that_vanished_since_it_was_listed_is_named(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = [root / "b" / "1.off", root / "b" / "gone.off"]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(listed))
    with pytest.raises(FileNotFoundError, match=r"gone\.off cannot be read: No such file"):
        names(root / "b")


def test_two_links_to_one_file_are_two_files(root: Path) -> None:
    (root / "again.txt").symlink_to(root / "c.txt")
    assert "again.txt" in names(root)
    assert "c.txt" in names(root)


@pytest.mark.parametrize("name", ["caf\xe9_0001.off", "Stra\xdfe"])
def test_a_name_in_latin1_is_refused_with_its_folder(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "chair" / "train"
    folder.mkdir(parents=True)
    (folder / "chair_0001.off").touch()
    (folder / os.fsdecode(name.encode("latin-1"))).touch()
    with pytest.raises(ValueError, match=r"chair/train needs names in UTF-8, it holds b'.*\\x"):
        entries(folder)
    with pytest.raises(ValueError, match=r"chair/train needs names in UTF-8.*Latin-1"):
        list(walk_files(tmp_path))


def test_a_name_in_utf8_is_listed(tmp_path: Path) -> None:
    (tmp_path / "caf\xe9_0001.off").touch()
    assert [path.name for path in entries(tmp_path)] == ["caf\xe9_0001.off"]
