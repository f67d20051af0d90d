"""Zip archives from anywhere: every member in its place, or one sentence."""

import io
import re
import stat
import tarfile
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pcrdiff.datasets.unpacking import unpack_zip

WORDS = b"the same words again and again " * 2000
NOISE = np.random.default_rng(0).bytes(3000)


def write_zip(path: Path, members: list[tuple[str, bytes]], method: int = 0) -> Path:
    with warnings.catch_warnings(), zipfile.ZipFile(path, "w", method) as archive:
        warnings.simplefilter("ignore")  # of names that come twice
        for name, content in members:
            archive.writestr(name, content)
    return path


def files_of(folder: Path) -> dict[str, bytes]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


@pytest.mark.parametrize("root", ["./", ".", ".\\", "././"])
def test_a_member_that_is_the_folder_itself_adds_nothing(tmp_path: Path, root: str) -> None:
    members = [(root, b""), ("./a/b.txt", b"b"), ("a/./c.txt", b"c"), ("a//d.txt", b"d")]
    path = write_zip(tmp_path / "x.zip", members)
    unpack_zip(path, tmp_path / "out")
    assert files_of(tmp_path / "out") == {"a/b.txt": b"b", "a/c.txt": b"c", "a/d.txt": b"d"}


def test_backslashes_part_folders(tmp_path: Path) -> None:
    members = [("bed\\", b""), ("bed\\train\\bed_0001.off", b"1"), ("bed/test\\2.off", b"2")]
    unpack_zip(write_zip(tmp_path / "x.zip", members), tmp_path / "out")
    assert files_of(tmp_path / "out") == {"bed/train/bed_0001.off": b"1", "bed/test/2.off": b"2"}
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["bed"]


@pytest.mark.parametrize("name", ["__MACOSX/._a", "__MACOSX\\._a", "./__MACOSX/._a", "__MACOSX/"])
def test_the_litter_of_macos_is_left_out(tmp_path: Path, name: str) -> None:
    unpack_zip(write_zip(tmp_path / "x.zip", [("a", b"a"), (name, b"")]), tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a"]


@pytest.mark.parametrize(
    "name",
    ["../a", "\\a", "\\\\host\\share\\a", "b\\..\\..\\a", "C:\\a", "//a", "./../a", ".\\..\\a"],
)
def test_a_member_elsewhere_is_refused_before_anything_is_written(
    tmp_path: Path, name: str
) -> None:
    path = write_zip(tmp_path / "x.zip", [("fine", b"a"), (name, b"a")])
    with pytest.raises(ValueError, match=r"x\.zip needs members inside its own folder") as refusal:
        unpack_zip(path, tmp_path / "out")
    assert repr(name) in str(refusal.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["NUL", "a/con.off", "a\\Aux.tar.gz", "COM1/a", "lpt9 .txt"])
def test_the_name_of_a_device_is_refused(tmp_path: Path, name: str) -> None:
    path = write_zip(tmp_path / "x.zip", [("console/null.off", b"a"), (name, b"a")])
    with pytest.raises(ValueError, match="needs members that are files or folders"):
        unpack_zip(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK])
def test_a_link_a_pipe_and_a_device_are_refused(tmp_path: Path, kind: int) -> None:
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as archive:
        plain, special = zipfile.ZipInfo("plain"), zipfile.ZipInfo("special")
        plain.external_attr, special.external_attr = stat.S_IFREG << 16, kind << 16
        archive.writestr(plain, b"")
        archive.writestr(special, b"/etc/passwd")
    with pytest.raises(ValueError, match="that are files or folders, got 'special'"):
        unpack_zip(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("again", ["a/b", "./a/b", "a\\b", "a//b"])
def test_two_members_for_one_place_are_refused(tmp_path: Path, again: str) -> None:
    path = write_zip(tmp_path / "x.zip", [("a/b", b"1"), (again, b"2")])
    with pytest.raises(ValueError, match=r"x\.zip needs new members, got 'a/b' again"):
        unpack_zip(path, tmp_path / "out")


def test_two_archives_do_not_overwrite_each_other(tmp_path: Path) -> None:
    for name in ("x", "y"):
        write_zip(tmp_path / f"{name}.zip", [("shared/", b""), ("shared/a", name.encode())])
    unpack_zip(tmp_path / "x.zip", tmp_path / "out")
    with pytest.raises(ValueError, match=r"y\.zip needs new members"):
        unpack_zip(tmp_path / "y.zip", tmp_path / "out")
    assert files_of(tmp_path / "out") == {"shared/a": b"x"}


def test_a_file_where_another_member_needs_a_folder_is_named(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "x.zip", [("a", b"1"), ("a/b", b"2")])
    with pytest.raises(OSError, match=r"x\.zip cannot be unpacked at 'a/b'"):
        unpack_zip(path, tmp_path / "out")


METHODS = [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("content", [WORDS, NOISE])
@pytest.mark.parametrize("place", [0.0, 0.1, 0.5, 0.9])
def test_damage_within_a_member_is_said_of_archive_and_member(
    tmp_path: Path, method: int, content: bytes, place: float
) -> None:
    path = write_zip(tmp_path / "x.zip", [("a.off", content)], method)
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("a.off").compress_size
    damaged = bytearray(path.read_bytes())
    start = 30 + len("a.off") + int(place * size)
    damaged[start : start + 8] = bytes(255 - byte for byte in damaged[start : start + 8])
    path.write_bytes(damaged)
    with pytest.raises((ValueError, OSError), match=r"x\.zip .*'a\.off'") as refusal:
        unpack_zip(path, tmp_path / "out")
    assert type(refusal.value) in (ValueError, OSError)


@pytest.mark.parametrize("method", METHODS)
def test_a_member_that_ends_early_is_said_so(tmp_path: Path, method: int) -> None:
    path = write_zip(tmp_path / "x.zip", [("a.off", NOISE)], method)
    whole = path.read_bytes()
    start = whole.index(b"PK\x01\x02")
    shorter = bytearray(whole)
    for place in (18, start + 20):  # the compressed size, in both headers
        size = int.from_bytes(whole[place : place + 4], "little") // 2
        shorter[place : place + 4] = size.to_bytes(4, "little")
    path.write_bytes(shorter)
    with pytest.raises(ValueError, match=r"x\.zip needs to be a plain zip archive, got: 'a\.off'"):
        unpack_zip(path, tmp_path / "out")


def test_an_encrypted_member_is_said_so(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "x.zip", [("a.off", NOISE)])
    flagged = bytearray(path.read_bytes())
    flagged[6] |= 1
    flagged[flagged.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(flagged)
    with pytest.raises(ValueError, match=r"x\.zip needs .*'a\.off'.* encrypted"):
        unpack_zip(path, tmp_path / "out")


@pytest.mark.parametrize("kept", [0, 10, 0.3, 0.7, 0.99])
def test_an_archive_that_was_cut_is_said_so(tmp_path: Path, kept: float) -> None:
    path = write_zip(tmp_path / "x.zip", [("a.off", NOISE)])
    whole = path.read_bytes()
    path.write_bytes(whole[: int(kept * len(whole)) if kept < 1 else int(kept)])
    with pytest.raises(ValueError, match=r"x\.zip needs to be a plain zip archive"):
        unpack_zip(path, tmp_path / "out")


def test_a_tar_is_not_taken_for_a_zip(tmp_path: Path) -> None:
    buffer = io.BytesIO(NOISE)
    with tarfile.open(tmp_path / "x.zip", "w:gz") as archive:
        member = tarfile.TarInfo("a")
        member.size = len(NOISE)
        archive.addfile(member, buffer)
    with pytest.raises(ValueError, match=re.escape("x.zip needs to be a plain zip archive")):
        unpack_zip(tmp_path / "x.zip", tmp_path / "out")
