"""Archives from the network: resumed, verified, and unpacked as a whole or not at all."""

import hashlib
import io
import socket
import ssl
import zipfile
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.error import URLError

import numpy as np
import pytest

from pcrdiff.datasets import download
from pcrdiff.datasets.download import Archive, download_archives, refuse_download

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

    monkeypatch.setattr(download, "urlopen", refuse)
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
    monkeypatch.setattr(download, "TIMEOUT_SECONDS", 0.1)
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
