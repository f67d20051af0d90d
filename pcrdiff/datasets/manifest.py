"""The manifest of a data set: its files with their sizes and digests, wherever they lie."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pcrdiff.datasets.listing import entries, naming, walk_files
from pcrdiff.loops import Progress, silent

Origin = Literal["synthetic", "local", "download"]
MANIFEST = "manifest.json"
SCHEMA = 1


def write_manifest(
    root: Path, out: Path, *, source: Origin, base: Path = Path(), progress: Progress = silent
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
    place = str(root) if source == "local" else "."
    manifest = {"schema": SCHEMA, "source": source, "root": place, "files": files}
    out.mkdir(parents=True, exist_ok=True)
    partial = out / f".{MANIFEST}.part"
    partial.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    partial.replace(out / MANIFEST)


def _list_files(folder: Path, skip: Path) -> list[Path]:
    kept = (path for path in walk_files(folder) if path.absolute() != skip.absolute())
    return sorted(kept, key=lambda path: path.relative_to(folder).as_posix())


def _describe(path: Path, folder: Path) -> dict[str, str | int]:
    with naming(path, "read"):
        size, digest = path.stat().st_size, hash_file(path)
    return {"path": path.relative_to(folder).as_posix(), "size": size, "sha256": digest}


def hash_file(path: Path) -> str:
    """The sha256 of a file, in hexadecimal."""
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


@dataclass(frozen=True)
class Manifest:
    """What is known of an acquired data set."""

    root: Path
    """Its folder: the one with the manifest, or the local root."""
    source: Origin
    files: Sequence[Mapping[str, Any]]
    """``path`` below the root, ``size`` and ``sha256`` of each."""

    @property
    def sha256(self) -> str:
        """One digest over all files."""
        digests = "".join(f"{entry['path']} {entry['sha256']}\n" for entry in self.files)
        return hashlib.sha256(digests.encode()).hexdigest()

    @property
    def digests(self) -> dict[Path, str]:
        """The sha256 of each file, by its real path."""
        return {(self.root / entry["path"]).resolve(): entry["sha256"] for entry in self.files}


def read_manifest(folder: Path, *, base: Path, changed_since: int = 0) -> Manifest:
    """Find the data set that a manifest describes, and check that it is still what it was.

    The content of a local one is checked too, since it lies where anyone may change it.

    Args:
        folder: The folder that holds ``manifest.json``.
        base: What a relative local root is relative to: the project's own folder.
        changed_since: Read only the local files that were touched after this, in ns since 1970.

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
    return Manifest(root, manifest["source"], manifest["files"])


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
