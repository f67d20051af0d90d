"""Getting hold of a data set: a manifest of a local folder, or archives from the network."""

import hashlib
import json
import shutil
import socket
import ssl
from collections.abc import Sequence
from dataclasses import dataclass
from http.client import HTTPException, HTTPResponse, InvalidURL
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any, Literal
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

from pcrdiff.data.tree import entries, walk_files
from pcrdiff.data.unpacking import unpack_zip
from pcrdiff.loops import Progress, silent

Source = Literal["synthetic", "local", "download"]
MANIFEST = "manifest.json"
SCHEMA = 1
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


# The manifest.


def write_manifest(
    root: Path, out: Path, *, source: Source, base: Path = Path(), progress: Progress = silent
) -> None:
    """Write ``out/manifest.json``: each file below ``root`` with its size and sha256.

    Nothing is copied. The root is written as it was given, so a relative one stays relative and
    means the same on another machine.

    Args:
        root: The data set's folder; ``out`` itself unless ``source`` is ``local``. Links to files
            and folders are followed.
        out: Where the manifest goes; made if absent.
        source: How the data set came here.
        base: What a relative root of a local data set is relative to: the project's own folder.
        progress: Watches the files being hashed.

    Raises:
        FileNotFoundError: No such folder.
        ValueError: The folder holds no file.
    """
    folder = base / root.expanduser() if source == "local" else root
    if not folder.is_dir():
        raise FileNotFoundError(f"a {source} data set needs its folder, {root} is not one")
    paths = _list_files(folder, skip=out / MANIFEST)
    if not paths:
        raise ValueError(f"a {source} data set needs at least one file, {root} holds none")
    files = [_describe(path, folder) for path in progress(paths, f"hashing {root.name}")]
    manifest = {
        "schema": SCHEMA,
        "source": source,
        "root": str(root) if source == "local" else ".",
        "files": files,
    }
    out.mkdir(parents=True, exist_ok=True)
    partial = out / f".{MANIFEST}.part"
    partial.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    partial.replace(out / MANIFEST)


def _list_files(folder: Path, skip: Path) -> list[Path]:
    kept = (path for path in walk_files(folder) if path.absolute() != skip.absolute())
    return sorted(kept, key=lambda path: path.relative_to(folder).as_posix())


def _describe(path: Path, folder: Path) -> dict[str, str | int]:
    """What a manifest says of one file."""
    try:
        size, digest = path.stat().st_size, _hash_file(path)
    except OSError as error:
        raise type(error)(f"{path} cannot be read: {error.strerror or error}") from error
    return {"path": path.relative_to(folder).as_posix(), "size": size, "sha256": digest}


def _hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def refuse_foreign(folder: Path) -> None:
    """Refuse to replace a folder that holds anything but a data set and its manifest.

    Nothing, or an empty folder, may be replaced; so may what ``write_manifest`` described, as long
    as it is still that.

    Raises:
        FileExistsError: It is a link or a file, it has no manifest, or it holds a file that its
            manifest does not describe: a user's own.
        OSError: It cannot be read.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        kind = "a link" if folder.is_symlink() else "a file"
        raise FileExistsError(f"acquire needs {folder} for itself, {kind} is there: move it away")
    if not folder.is_dir() or not entries(folder):
        return
    described = _described(folder)
    for path in _list_files(folder, skip=folder / MANIFEST):
        if described.get(path.relative_to(folder).as_posix()) != _describe(path, folder):
            raise FileExistsError(
                f"acquire needs {folder} for itself, {path} is not from an acquire stage: "
                "move it away"
            )


def _described(folder: Path) -> dict[str, dict[str, str | int]]:
    """The files that lie in a folder itself, by the manifest that lies there too."""
    try:
        manifest = _load_manifest(folder / MANIFEST)
        files = {} if manifest["source"] == "local" else manifest["files"]
        return {entry["path"]: entry for entry in files}
    except (FileNotFoundError, ValueError, TypeError, KeyError) as error:
        raise FileExistsError(
            f"acquire needs {folder} for itself, it holds files and no {MANIFEST} of an acquire "
            "stage: move it away"
        ) from error


def read_manifest(folder: Path, *, base: Path, changed_since: int = 0) -> Path:
    """Find the data set that a manifest describes, and check that it is still what it was.

    A local one is read whole for that: it lies where anyone may change it.

    Args:
        folder: The folder that holds ``manifest.json``.
        base: What a relative local root is relative to: the project's own folder.
        changed_since: Read only the local files that were touched after this, in ns since 1970.

    Returns:
        The data set's folder: ``folder`` itself, or the local root.

    Raises:
        FileNotFoundError: The manifest, the root or one of its files is gone.
        ValueError: The manifest is not one, a file has another size than it says, or a local data
            set has a file with other content or one more than it says.
        OSError: A file or folder of a local data set cannot be read.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise FileNotFoundError(f"a data set needs its manifest {path}, run its acquire stage")
    manifest = _load_manifest(path)
    local = manifest["source"] == "local"
    root = base / Path(manifest["root"]).expanduser() if local else folder
    if not root.is_dir():
        raise FileNotFoundError(f"{path} needs the data set's folder {root}, which is gone")
    for entry in manifest["files"]:
        file = root / entry["path"]
        if not file.is_file():
            raise FileNotFoundError(f"{path} needs {file}, which is gone")
        if file.stat().st_size != entry["size"]:
            raise ValueError(
                f"{path} needs {file} with {entry['size']} bytes, it has {file.stat().st_size}: "
                "run the acquire stage again if that is meant"
            )
    if local:
        _check_content(path, manifest["files"], root, changed_since)
    return root


def _check_content(
    manifest: Path, described: Sequence[dict[str, Any]], root: Path, changed_since: int
) -> None:
    """Refuse files whose content is not the described one, and files that nothing describes.

    Hidden ones may come: no reader takes them, and file managers leave them behind.
    """
    files = {entry["path"]: entry for entry in described}
    for path in _list_files(root, skip=manifest):
        entry = files.get(path.relative_to(root).as_posix())
        if entry is None and not path.name.startswith("."):
            raise ValueError(f"{manifest} knows no {path}: run the acquire stage again")
        touched = max(path.stat().st_mtime_ns, path.stat().st_ctime_ns) >= changed_since
        if entry is not None and touched and _describe(path, root) != entry:
            raise ValueError(
                f"{manifest} needs {path} as it was when it was acquired, its content is another: "
                "run the acquire stage again"
            )


def is_stale(folder: Path, *, base: Path) -> bool:
    """Whether a local data set is no longer what its manifest says.

    Only files touched since the manifest was written are read.

    Args:
        folder: The folder that may hold ``manifest.json``.
        base: As for ``read_manifest``.

    Raises:
        ValueError: The manifest is not one.
        OSError: A file or folder of the data set cannot be read.
    """
    path = folder / MANIFEST
    if not path.is_file() or _load_manifest(path)["source"] != "local":
        return False
    try:
        read_manifest(folder, base=base, changed_since=path.stat().st_mtime_ns)
    except (ValueError, FileNotFoundError):
        return True
    return False


def read_source(folder: Path) -> tuple[str, str]:
    """How the data set of a manifest came here, and one sha256 over all its files."""
    manifest = _load_manifest(folder / MANIFEST)
    digests = "".join(f"{entry['path']} {entry['sha256']}\n" for entry in manifest["files"])
    return manifest["source"], hashlib.sha256(digests.encode()).hexdigest()


def read_digests(folder: Path, root: Path) -> dict[Path, str]:
    """The sha256 of each file of a manifest, by its real path.

    Args:
        folder: The folder that holds ``manifest.json``.
        root: The data set's folder, as ``read_manifest`` finds it.
    """
    files = _load_manifest(folder / MANIFEST)["files"]
    return {(root / entry["path"]).resolve(): entry["sha256"] for entry in files}


def _load_manifest(path: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path} needs to be JSON, got: {error}") from error
    keys = {"schema", "source", "root", "files"}
    if not isinstance(manifest, dict) or not keys <= manifest.keys():
        raise ValueError(f"{path} needs to be a manifest with {', '.join(sorted(keys))}")
    if manifest["schema"] != SCHEMA:
        raise ValueError(f"{path} needs schema {SCHEMA}, got {manifest['schema']}")
    return manifest


# Archives from the network.


def download_archives(
    archives: Sequence[Archive], out: Path, *, cache: Path, progress: Progress = silent
) -> None:
    """Download zip archives, verify them all, and unpack them side by side into ``out``.

    A download that was cut goes on where it stopped when this is called again. ``out`` is replaced
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
        if _is_lasting(error):
            raise ConnectionError(
                f"{url} cannot be downloaded, nor by running again: "
                f"{getattr(error, 'reason', error)}"
            ) from error
        held = part.stat().st_size if part.is_file() else 0
        raise ConnectionError(
            f"{url} was cut after {held} bytes ({getattr(error, 'reason', error)}), "
            f"run again to go on from there; they are kept as {part}"
        ) from error


def _is_lasting(error: Exception) -> bool:
    """Whether the address or the server's certificate is wrong, rather than the connection."""
    reason = getattr(error, "reason", error)
    if isinstance(error, URLError) and isinstance(reason, ssl.SSLError):  # no agreement on TLS
        return not isinstance(reason, ssl.SSLEOFError | ssl.SSLZeroReturnError)
    unknown = isinstance(reason, socket.gaierror) and reason.errno == socket.EAI_NONAME
    return unknown or isinstance(error, InvalidURL | UnicodeError)


def _receive(response: HTTPResponse, part: Path, held: int, progress: Progress) -> None:
    """Append what the server sends, or start anew where it ignored the range."""
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
    found = [
        (archive, path, _hash_file(path)) for archive, path in zip(archives, paths, strict=True)
    ]
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
