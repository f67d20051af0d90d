"""Downloading the archives of a data set: resumed where cut, verified, unpacked as a whole or not at all."""

import hashlib
import shutil
import socket
import ssl
from collections.abc import Sequence
from dataclasses import dataclass
from http.client import HTTPException, HTTPResponse, InvalidURL
from itertools import count
from pathlib import Path, PurePosixPath
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from pcrdiff.datasets.manifest import hash_file
from pcrdiff.datasets.unpacking import unpack_zip
from pcrdiff.loops import Progress, silent

CHUNK_BYTES = 1 << 20
TIMEOUT_SECONDS = 30.0


@dataclass(frozen=True)
class Archive:
    """A public zip archive."""

    url: str
    sha256: str | None
    """Its digest in hexadecimal; ``None`` where the user has yet to learn it."""


def refuse_download(dataset: str) -> None:
    """Refuse to download what may be had only by an account of one's own.

    Raises:
        ValueError: The data set is KITTI.
    """
    if dataset.startswith("kitti"):
        raise ValueError(
            "KITTI cannot be downloaded without your own account at www.cvlibs.net: get the "
            "odometry velodyne scans, calibration and poses there, unpack them, and use "
            "`source: local` with that folder"
        )


def download_archives(
    archives: Sequence[Archive], out: Path, *, cache: Path, progress: Progress = silent
) -> None:
    """Download zip archives, verify them all, and unpack them side by side into ``out``.

    An interrupted download resumes when this is called again. ``out`` is replaced
    as a whole at the end, or not touched at all.

    Args:
        archives: What to download; their digests decide whether they are used.
        out: The folder to make.
        cache: Where whole and half archives stay between calls.
        progress: Watches the chunks of each archive, and the archives being unpacked.

    Raises:
        ConnectionError: A server refused, or the download was cut, or the disk is full.
        ValueError: No archive, a digest that is missing (the message gives what was found) or
            wrong (the archive is removed), or an archive that ``unpack_zip`` refuses.
        OSError: ``out`` cannot be written.
    """
    if not archives:
        raise ValueError(f"download_archives needs an archive for {out}, got none")
    paths = [_fetch(archive.url, cache, progress) for archive in archives]
    _verify(archives, paths)
    staging = out.with_name(f".{out.name}.part")
    shutil.rmtree(staging, ignore_errors=True)
    try:
        staging.mkdir(parents=True)
        for path in progress(paths, f"unpacking {out.name}"):
            unpack_zip(path, staging)
        if out.exists():
            shutil.rmtree(out)
        staging.replace(out)
    except OSError as error:
        raise OSError(f"unpacking into {out} failed, it stays as it was: {error}") from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _fetch(url: str, cache: Path, progress: Progress) -> Path:
    """Give the whole archive in the cache, downloading what is not there yet."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https"):
        raise ValueError(f"download_archives needs http or https, got {url!r}")
    cache.mkdir(parents=True, exist_ok=True)
    key = hashlib.sha256(url.encode()).hexdigest()[:8]  # two hosts may use one file name
    path = cache / f"{key}-{PurePosixPath(parts.path).name}"
    if not path.is_file():
        part = path.with_name(f"{path.name}.part")
        _download(url, part, progress)
        part.replace(path)
    return path


def _download(url: str, part: Path, progress: Progress) -> None:
    held = part.stat().st_size if part.is_file() else 0
    headers = {"User-Agent": "pcrdiff"} | ({"Range": f"bytes={held}-"} if held else {})
    try:
        with urlopen(Request(url, headers=headers), timeout=TIMEOUT_SECONDS) as response:
            _receive(response, part, held, progress)
    except HTTPError as error:
        if error.code == 416 and held:  # nothing after what is held: it was whole, or is stale
            part.unlink()
            return _download(url, part, progress)
        raise ConnectionError(
            f"{url} cannot be downloaded, the server answered {error.code} {error.reason}"
        ) from error
    except (HTTPException, OSError, UnicodeError) as error:  # refused, timed out, cut, disk full
        reason = getattr(error, "reason", error)
        if _is_lasting(error):
            lasting = f"{url} cannot be downloaded, nor by running again: {reason}"
            raise ConnectionError(lasting) from error
        held = part.stat().st_size if part.is_file() else 0
        raise ConnectionError(
            f"{url} was cut after {held} bytes ({reason}), run again to go on from there; they are "
            f"kept as {part}"
        ) from error


def _is_lasting(error: Exception) -> bool:
    """Whether the address or the server's certificate is wrong, rather than the connection."""
    reason = getattr(error, "reason", error)
    if isinstance(error, URLError) and isinstance(reason, ssl.SSLError):  # no agreement on TLS
        return not isinstance(reason, ssl.SSLEOFError | ssl.SSLZeroReturnError)
    unknown = isinstance(reason, socket.gaierror) and reason.errno == socket.EAI_NONAME
    return unknown or isinstance(error, InvalidURL | UnicodeError)


def _receive(response: HTTPResponse, part: Path, held: int, progress: Progress) -> None:
    """Append what the server sends, or start again where it ignored the range."""
    resumes = response.headers.get("Content-Range", "").startswith(f"bytes {held}-")
    length = response.headers.get("Content-Length")
    chunks = range(-(-int(length) // CHUNK_BYTES)) if length else None
    received = 0
    with part.open("ab" if resumes else "wb") as file:
        for _ in count() if chunks is None else progress(chunks, f"downloading {part.stem}"):
            chunk = response.read(CHUNK_BYTES)
            if not chunk:
                break
            received += file.write(chunk)
    if length and received < int(length):
        raise ConnectionError(f"{int(length) - received} bytes missing")


def _verify(archives: Sequence[Archive], paths: Sequence[Path]) -> None:
    """Refuse the archives unless each has the digest it is asked to have."""
    found = list(zip(archives, paths, map(hash_file, paths), strict=True))
    for archive, path, actual in found:
        if archive.sha256 is not None and archive.sha256.lower() != actual:
            path.unlink()
            raise ValueError(
                f"{archive.url} needs sha256 {archive.sha256}, got {actual}: it was removed"
            )
    unknown = [f"{archive.url} {actual}" for archive, _, actual in found if archive.sha256 is None]
    if unknown:
        raise ValueError(
            "download_archives needs a sha256 for each archive; put these into the params once you "
            f"have checked them (nothing is downloaded twice): {', '.join(unknown)}"
        )
