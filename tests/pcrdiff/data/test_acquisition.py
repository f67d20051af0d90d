"""Manifests of local folders, and downloads from a server that fails in every way it can."""

import hashlib
import io
import json
import os
import socket
import ssl
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.error import URLError

import numpy as np
import pytest

from pcrdiff.data import acquisition
from pcrdiff.data.acquisition import (
    Archive,
    download_archives,
    is_stale,
    read_manifest,
    refuse_download,
    write_manifest,
)
from pcrdiff.loops import T

CONTENT = np.random.default_rng(0).bytes(300_000)


def make_zip(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def hash_bytes(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


class Server(ThreadingHTTPServer):
    """Serves ``files``; may cut the next answer, and may ignore ranges."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.files: dict[str, bytes] = {}
        self.cut_after: int | None = None
        self.honours_ranges = True
        self.ranges: list[str | None] = []
        """The ``Range`` header of each request."""

    def give(self, name: str, content: bytes) -> str:
        """Serve a file, and tell its address."""
        self.files[f"/{name}"] = content
        return f"http://127.0.0.1:{self.server_address[1]}/{name}"


class Handler(BaseHTTPRequestHandler):
    """Answers as its server was told to."""

    server: Server

    def do_GET(self) -> None:
        """Answer one request."""
        asked = self.headers.get("Range")
        self.server.ranges.append(asked)
        content = self.server.files.get(self.path)
        if content is None:
            return self.send_error(404, "Not Found")
        start = 0
        if asked and self.server.honours_ranges:
            start = int(asked.removeprefix("bytes=").removesuffix("-"))
        if start >= len(content):
            return self.send_error(416, "Range Not Satisfiable")
        self.send_response(206 if start else 200)
        if start:
            end = len(content) - 1
            self.send_header("Content-Range", f"bytes {start}-{end}/{len(content)}")
        self.send_header("Content-Length", str(len(content) - start))
        self.end_headers()
        stop, self.server.cut_after = self.server.cut_after, None
        self.wfile.write(content[start:] if stop is None else content[start : start + stop])
        return None

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as running:
        thread = Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield running
        running.shutdown()
        thread.join()


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    """Give ``out`` and ``cache``."""
    return tmp_path / "raw" / "modelnet40", tmp_path / "cache"


def list_files(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_unpacks_archives_side_by_side(server: Server, folders: tuple[Path, Path]) -> None:
    out, cache = folders
    first = make_zip({"scene/cloud_bin_0.ply": CONTENT, "__MACOSX/._scene": b"litter"})
    second = make_zip({"scene-evaluation/gt.log": b"log"})
    archives = [
        Archive(server.give("a/x.zip", first), hash_bytes(first)),
        Archive(server.give("b/x.zip", second), hash_bytes(second).upper()),
    ]
    download_archives(archives, out, cache=cache)
    assert list_files(out) == [
        "scene",
        "scene-evaluation",
        "scene-evaluation/gt.log",
        "scene/cloud_bin_0.ply",
    ]
    assert (out / "scene/cloud_bin_0.ply").read_bytes() == CONTENT
    assert list_files(out.parent) == ["modelnet40", *(f"modelnet40/{n}" for n in list_files(out))]


def test_downloads_nothing_twice_and_replaces_what_was_there(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    content = make_zip({"a.txt": b"a"})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    download_archives([archive], out, cache=cache)
    (out / "stale.txt").write_text("from another run")
    download_archives([archive], out, cache=cache)
    assert list_files(out) == ["a.txt"]
    assert server.ranges == [None]


def test_goes_on_where_a_download_was_cut(server: Server, folders: tuple[Path, Path]) -> None:
    out, cache = folders
    content = make_zip({"a.bin": CONTENT})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    server.cut_after = 100_000
    with pytest.raises(ConnectionError, match=r"x\.zip was cut after 100000 bytes .* run again"):
        download_archives([archive], out, cache=cache)
    assert not out.exists()
    download_archives([archive], out, cache=cache)
    assert server.ranges == [None, "bytes=100000-"]
    assert (out / "a.bin").read_bytes() == CONTENT


def test_starts_anew_when_the_server_knows_no_ranges(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    content = make_zip({"a.bin": CONTENT})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    server.cut_after, server.honours_ranges = 100_000, False
    with pytest.raises(ConnectionError):
        download_archives([archive], out, cache=cache)
    download_archives([archive], out, cache=cache)
    assert (out / "a.bin").read_bytes() == CONTENT


def test_starts_anew_when_the_half_file_is_longer_than_the_whole(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    content = make_zip({"a.bin": CONTENT})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    server.cut_after = 100_000
    with pytest.raises(ConnectionError):
        download_archives([archive], out, cache=cache)
    (part,) = cache.glob("*.part")
    part.write_bytes(bytes(len(content)))
    download_archives([archive], out, cache=cache)
    assert (out / "a.bin").read_bytes() == CONTENT


def test_refuses_a_wrong_digest_and_removes_the_archive(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    content = make_zip({"a.txt": b"a"})
    wrong = "0" * 64
    archive = Archive(server.give("x.zip", content), wrong)
    with pytest.raises(ValueError, match=f"needs sha256 {wrong}, got {hash_bytes(content)}"):
        download_archives([archive], out, cache=cache)
    assert list(cache.iterdir()) == []
    assert not out.exists()


def test_tells_every_digest_that_the_params_lack(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    contents = [make_zip({f"{name}.txt": b"a"}) for name in "ab"]
    urls = [server.give(f"{i}.zip", content) for i, content in enumerate(contents)]
    with pytest.raises(ValueError, match="needs a sha256 for each archive") as refusal:
        download_archives([Archive(url, None) for url in urls], out, cache=cache)
    for url, content in zip(urls, contents, strict=True):
        assert f"{url} {hash_bytes(content)}" in str(refusal.value)
    assert not out.exists()
    pairs = zip(urls, contents, strict=True)
    download_archives([Archive(url, hash_bytes(c)) for url, c in pairs], out, cache=cache)
    assert len(server.ranges) == 2


def test_tells_what_the_server_answered(server: Server, folders: tuple[Path, Path]) -> None:
    url = server.give("x.zip", b"").replace("x.zip", "y.zip")
    with pytest.raises(ConnectionError, match=r"y\.zip cannot be downloaded.* 404 Not Found"):
        download_archives([Archive(url, "0" * 64)], folders[0], cache=folders[1])
    assert not folders[0].exists()


def test_tells_of_a_server_that_is_not_there(folders: tuple[Path, Path]) -> None:
    archive = Archive("http://127.0.0.1:9/x.zip", "0" * 64)
    with pytest.raises(ConnectionError, match=r"x\.zip was cut after 0 bytes .*refused"):
        download_archives([archive], folders[0], cache=folders[1])


LASTING = [
    ssl.SSLCertVerificationError(1, "certificate verify failed: certificate has expired"),
    ssl.SSLError(1, "unsupported protocol"),
    socket.gaierror(socket.EAI_NONAME, "Name or service not known"),
]
PASSING = [
    ssl.SSLEOFError(8, "EOF occurred in violation of protocol"),
    socket.gaierror(socket.EAI_AGAIN, "Temporary failure in name resolution"),
    TimeoutError("timed out"),
]


@pytest.mark.parametrize("reason", [*LASTING, *PASSING], ids=lambda reason: str(reason))
def test_what_stays_wrong_is_not_called_a_cut(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, reason: OSError
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise URLError(reason)

    monkeypatch.setattr(acquisition, "urlopen", refuse)
    archive = Archive("https://127.0.0.1:9/x.zip", "0" * 64)
    with pytest.raises(ConnectionError, match=r"x\.zip") as refusal:
        download_archives([archive], folders[0], cache=folders[1])
    said = str(refusal.value)
    assert str(reason) in said
    assert ("cannot be downloaded" in said) == (reason in LASTING)
    assert ("was cut" in said) == (reason in PASSING)


@pytest.mark.parametrize(
    "url",
    ["http://127.0.0.1:port/x.zip", f"http://{'a' * 70}.b/x.zip", "http://127.0.0.1:9/a b.zip"],
)
def test_an_address_that_is_none_is_not_called_a_cut(folders: tuple[Path, Path], url: str) -> None:
    with pytest.raises(ConnectionError, match="cannot be downloaded") as refusal:
        download_archives([Archive(url, "0" * 64)], folders[0], cache=folders[1])
    assert str(refusal.value).startswith(url)


def test_tells_of_a_server_that_hangs(
    folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(acquisition, "TIMEOUT_SECONDS", 0.1)
    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as silent_server:  # it never accepts
        archive = Archive(f"http://127.0.0.1:{silent_server.server_address[1]}/x.zip", "0" * 64)
        with pytest.raises(ConnectionError, match="timed out"):
            download_archives([archive], folders[0], cache=folders[1])


def test_tells_of_a_full_disk_and_leaves_out_untouched(
    server: Server, folders: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, cache = folders
    content = make_zip({"a.txt": b"new"})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    out.mkdir(parents=True)
    (out / "a.txt").write_text("old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "extractall", fail)
    with pytest.raises(OSError, match=r"it stays as it was: .*No space left on device"):
        download_archives([archive], out, cache=cache)
    assert (out / "a.txt").read_text() == "old"
    assert list_files(out.parent) == ["modelnet40", "modelnet40/a.txt"]


@pytest.mark.parametrize("name", ["../a.txt", "/a.txt", "b/../../a.txt", "..\\a.txt", "C:/a.txt"])
def test_refuses_an_archive_that_would_write_elsewhere(
    server: Server, folders: tuple[Path, Path], name: str
) -> None:
    out, cache = folders
    content = make_zip({"fine.txt": b"a", name: b"a"})
    archive = Archive(server.give("x.zip", content), hash_bytes(content))
    with pytest.raises(ValueError, match="needs members inside its own folder"):
        download_archives([archive], out, cache=cache)
    assert list_files(out.parent) == []


def test_refuses_what_is_no_zip(server: Server, folders: tuple[Path, Path]) -> None:
    archive = Archive(server.give("x.zip", CONTENT), hash_bytes(CONTENT))
    with pytest.raises(ValueError, match="needs to be a plain zip archive"):
        download_archives([archive], folders[0], cache=folders[1])


def test_what_cannot_be_unpacked_leaves_nothing_behind(
    server: Server, folders: tuple[Path, Path]
) -> None:
    out, cache = folders
    damaged = make_zip({"a.txt": b"whole", "b.txt": CONTENT}).replace(CONTENT[:64], bytes(64))
    archive = Archive(server.give("x.zip", damaged), hash_bytes(damaged))
    with pytest.raises(ValueError, match=r"x\.zip needs to be a plain zip archive, got: 'b\.txt'"):
        download_archives([archive], out, cache=cache)
    assert list_files(out.parent) == []


def test_refuses_no_archive_and_an_address_that_is_a_file(folders: tuple[Path, Path]) -> None:
    with pytest.raises(ValueError, match="needs an archive"):
        download_archives([], folders[0], cache=folders[1])
    with pytest.raises(ValueError, match="needs http or https"):
        download_archives([Archive("file:///x.zip", "0")], folders[0], cache=folders[1])


def test_refuses_to_download_kitti() -> None:
    refuse_download("modelnet40")
    with pytest.raises(ValueError, match=r"your own account at www\.cvlibs\.net.*source: local"):
        refuse_download("kitti")


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
    assert list_files(out) == ["manifest.json"]
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["root"] == str(local)
    assert [entry["path"] for entry in manifest["files"]] == ["a.txt", "b-a.txt", "b/1.bin"]
    assert manifest["files"][2] == {"path": "b/1.bin", "size": 3, "sha256": hash_bytes(b"one")}
    assert read_manifest(out, base=tmp_path) == local


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
    assert read_manifest(out, base=tmp_path) == local


def test_a_made_data_set_is_its_own_root_and_may_move(tmp_path: Path, local: Path) -> None:
    write_manifest(local, local, source="synthetic")
    manifest = json.loads((local / "manifest.json").read_text())
    assert manifest["root"] == "."
    assert len(manifest["files"]) == 3
    moved = local.rename(tmp_path / "moved")
    assert read_manifest(moved, base=tmp_path / "elsewhere") == moved


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
    assert read_manifest(out, base=tmp_path) == local


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
    assert list_files(out) == ["manifest.json"]


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
    assert read_manifest(tmp_path / "out", base=tmp_path) == local
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
