"""Manifests: what they list, and what has changed since."""

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pytest

from pcrdiff.datasets.manifest import is_stale, read_manifest, write_manifest
from pcrdiff.loops import T


@pytest.fixture
def local(tmp_path: Path) -> Path:
    root = tmp_path / "somewhere" / "kitti"
    for name, content in (("b/1.bin", b"one"), ("b-a.txt", b""), ("a.txt", b"three")):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_bytes(content)
    return root


def test_a_manifest_lists_sorted_files_and_copies_none(tmp_path: Path, local: Path) -> None:
    out = tmp_path / "out"
    write_manifest(local, out, source="local")
    assert [path.name for path in out.iterdir()] == ["manifest.json"]
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["root"] == str(local)
    assert [entry["path"] for entry in manifest["files"]] == ["a.txt", "b-a.txt", "b/1.bin"]
    assert manifest["files"][2] == {
        "path": "b/1.bin",
        "size": 3,
        "sha256": hashlib.sha256(b"one").hexdigest(),
    }
    assert read_manifest(out, base=tmp_path).root == local


def test_a_manifest_is_the_same_when_written_twice(tmp_path: Path, local: Path) -> None:
    for out in (tmp_path / "out", local):
        write_manifest(local, out, source="local")
        first = (out / "manifest.json").read_bytes()
        write_manifest(local, out, source="local")
        assert (out / "manifest.json").read_bytes() == first


def test_a_relative_root_is_kept_and_found_from_the_base(
    tmp_path: Path, local: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "out"
    write_manifest(Path("somewhere/kitti"), out, source="local")
    assert json.loads((out / "manifest.json").read_text())["root"] == "somewhere/kitti"
    monkeypatch.chdir("/")
    assert read_manifest(out, base=tmp_path).root == local


def test_a_made_data_set_is_its_own_root_and_may_move(tmp_path: Path, local: Path) -> None:
    write_manifest(local, local, source="synthetic")
    manifest = json.loads((local / "manifest.json").read_text())
    assert manifest["root"] == "."
    assert len(manifest["files"]) == 3
    moved = local.rename(tmp_path / "moved")
    assert read_manifest(moved, base=tmp_path / "elsewhere").root == moved


def test_a_manifest_follows_linked_folders(tmp_path: Path, local: Path) -> None:
    root = tmp_path / "linked"
    root.mkdir()
    (root / "sequences").symlink_to(local)
    write_manifest(root, tmp_path / "out", source="local")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["files"][0]["path"] == "sequences/a.txt"


@pytest.mark.parametrize("goal", [".", "..", "b"])
def test_a_manifest_names_each_file_once_where_a_link_leads_back(
    tmp_path: Path, local: Path, goal: str
) -> None:
    (local / "b" / "again").symlink_to(local / goal, target_is_directory=True)
    write_manifest(local, tmp_path / "out", source="local")
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    real = [(local / entry["path"]).resolve() for entry in manifest["files"]]
    assert sorted(real) == sorted(local / name for name in ("a.txt", "b-a.txt", "b/1.bin"))


REFUSED = [PermissionError(13, "Permission denied"), OSError(5, "Input/output error")]


@pytest.mark.parametrize("error", [*REFUSED, OSError(116, "Stale file handle")])
@pytest.mark.parametrize("method", ["iterdir", "open", "stat"])
def test_what_cannot_be_read_is_named_and_no_manifest_is_written(
    tmp_path: Path, local: Path, monkeypatch: pytest.MonkeyPatch, error: OSError, method: str
) -> None:
    place = local / ("b" if method == "iterdir" else "b/1.bin")
    original = getattr(Path, method)

    def refuse(path: Path, *args: object, **kwargs: object) -> object:
        if path == place:
            raise error
        return original(path, *args, **kwargs)

    monkeypatch.setattr(Path, method, refuse)
    with pytest.raises(type(error)) as refusal:
        write_manifest(local, tmp_path / "out", source="local")
    assert str(place) in str(refusal.value)
    assert str(error.strerror) in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_a_file_that_vanishes_while_others_are_hashed_is_named(tmp_path: Path, local: Path) -> None:
    def watch(items: Sequence[T], description: str) -> Iterable[T]:
        del description
        for item in items:
            (local / "b/1.bin").unlink(missing_ok=True)
            yield item

    with pytest.raises(FileNotFoundError, match=r"b/1\.bin cannot be read: No such file"):
        write_manifest(local, tmp_path / "out", source="local", progress=watch)
    assert not (tmp_path / "out").exists()


def test_refuses_a_local_folder_that_is_missing_or_empty(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="gone is not one"):
        write_manifest(tmp_path / "gone", tmp_path / "out", source="local")
    (tmp_path / "empty" / "deeper").mkdir(parents=True)
    with pytest.raises(ValueError, match="empty holds none"):
        write_manifest(tmp_path / "empty", tmp_path / "out", source="local")
    assert not (tmp_path / "out").exists()


def test_refuses_a_data_set_that_changed_since(tmp_path: Path, local: Path) -> None:
    out = tmp_path / "out"
    write_manifest(local, out, source="local")
    (local / "b/1.bin").write_bytes(b"longer")
    with pytest.raises(ValueError, match=r"1\.bin with 3 bytes, it has 6"):
        read_manifest(out, base=tmp_path)
    (local / "b/1.bin").unlink()
    with pytest.raises(FileNotFoundError, match=r"1\.bin, which is gone"):
        read_manifest(out, base=tmp_path)
    local.rename(tmp_path / "moved")
    with pytest.raises(FileNotFoundError, match="kitti, which is gone"):
        read_manifest(out, base=tmp_path)


@pytest.mark.parametrize("keeps_times", [True, False])
def test_refuses_a_local_file_that_was_replaced_by_one_as_long(
    tmp_path: Path, local: Path, keeps_times: bool
) -> None:
    out, path = tmp_path / "out", local / "b/1.bin"
    write_manifest(local, out, source="local")
    before = path.stat()
    path.write_bytes(b"two")
    if keeps_times:
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    with pytest.raises(ValueError, match=r"1\.bin as it was when it was acquired"):
        read_manifest(out, base=tmp_path)
    write_manifest(local, out, source="local")
    assert read_manifest(out, base=tmp_path).root == local


@pytest.mark.parametrize("change", ["content", "one more", "one less", "gone", "older file"])
def test_a_local_data_set_that_changed_is_stale(tmp_path: Path, local: Path, change: str) -> None:
    out, path = tmp_path / "out", local / "b/1.bin"
    (tmp_path / "old.bin").write_bytes(b"old")
    os.utime(tmp_path / "old.bin", (1, 1))
    write_manifest(local, out, source="local")
    assert not is_stale(out, base=tmp_path)
    changes: dict[str, Callable[[], object]] = {
        "content": lambda: path.write_bytes(b"two"),
        "one more": lambda: (local / "b/2.bin").write_bytes(b"two"),
        "one less": path.unlink,
        "gone": lambda: local.rename(tmp_path / "moved"),
        "older file": lambda: (tmp_path / "old.bin").rename(path),
    }
    changes[change]()
    assert is_stale(out, base=tmp_path)
    assert [path.name for path in out.iterdir()] == ["manifest.json"]


def test_what_was_only_touched_or_made_here_is_not_stale(tmp_path: Path, local: Path) -> None:
    write_manifest(local, tmp_path / "out", source="local")
    (local / "b/1.bin").touch()
    assert not is_stale(tmp_path / "out", base=tmp_path)
    write_manifest(local, local, source="synthetic")
    (local / "b/1.bin").write_bytes(b"two")
    assert not is_stale(local, base=tmp_path)
    assert (local / "manifest.json").is_file()


def test_refuses_a_local_file_that_came_since_unless_it_is_hidden(
    tmp_path: Path, local: Path
) -> None:
    write_manifest(local, tmp_path / "out", source="local")
    (local / "b" / ".DS_Store").write_bytes(b"litter")
    assert read_manifest(tmp_path / "out", base=tmp_path).root == local
    (local / "b" / "2.bin").write_bytes(b"two")
    with pytest.raises(ValueError, match=r"manifest\.json knows no .*b/2\.bin: run the acquire"):
        read_manifest(tmp_path / "out", base=tmp_path)


def test_refuses_a_local_data_set_whose_files_changed_places(tmp_path: Path, local: Path) -> None:
    (local / "b/2.bin").write_bytes(b"two")
    write_manifest(local, tmp_path / "out", source="local")
    (local / "b/1.bin").rename(local / "b/3")
    (local / "b/2.bin").rename(local / "b/1.bin")
    (local / "b/3").rename(local / "b/2.bin")
    with pytest.raises(ValueError, match=r"b/1\.bin as it was"):
        read_manifest(tmp_path / "out", base=tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "needs to be JSON"),
        ("[]", "needs to be a manifest"),
        ('{"root": "."}', "needs to be a manifest"),
        ('{"schema": 9, "source": "local", "root": ".", "files": []}', "needs schema 1, got 9"),
    ],
)
def test_refuses_a_manifest_that_is_none(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(ValueError, match=rf"manifest\.json {message}"):
        read_manifest(tmp_path, base=tmp_path)
    (tmp_path / "manifest.json").unlink()
    with pytest.raises(FileNotFoundError, match="run its acquire stage"):
        read_manifest(tmp_path, base=tmp_path)
