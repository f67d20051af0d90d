"""Unpacking a zip archive so that every member ends where its name says, or none does."""

import lzma
import stat
import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

DEVICES = frozenset(
    ["CON", "PRN", "AUX", "NUL", *(f"{port}{n}" for port in ("COM", "LPT") for n in range(1, 10))]
)
"""Names that are no files on Windows, whatever comes after a dot."""
DAMAGE = (
    zipfile.BadZipFile,
    NotImplementedError,
    RuntimeError,
    EOFError,
    UnicodeDecodeError,
    lzma.LZMAError,
    struct.error,
    zlib.error,
)


def unpack_zip(path: Path, folder: Path) -> None:
    """Unpack an archive beside what ``folder`` holds already; macOS's litter is left out.

    Backslashes in names part folders, as they do where such archives are made. After an error
    ``folder`` may hold some of the members.

    Raises:
        ValueError: It is no plain zip archive, it is damaged or encrypted, or a member would lie
            outside ``folder``, is a link or a device, or has the place of another.
        OSError: ``folder`` cannot be written.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            for member in _place_members(path, archive):
                if not member.is_dir() and (folder / member.filename).exists():
                    raise ValueError(f"{path} needs new members, got {member.filename!r} again")
                _extract(path, archive, member, folder)
    except DAMAGE as error:
        raise ValueError(f"{path} needs to be a plain zip archive, got: {error}") from error


def _extract(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path) -> None:
    try:
        archive.extractall(folder, [member])
    except DAMAGE as error:
        raise ValueError(
            f"{path} needs to be a plain zip archive, got: {member.filename!r}: {error}"
        ) from error
    except OSError as error:  # of the disk, or of a damaged bzip2 stream
        raise type(error)(f"{path} cannot be unpacked at {member.filename!r}: {error}") from error


def _place_members(path: Path, archive: zipfile.ZipFile) -> list[zipfile.ZipInfo]:
    """Every member under the name that it is to have; all are looked at before the first is given.

    Raises:
        ValueError: As for ``unpack_zip``.
    """
    kept = []
    for member in archive.infolist():
        name = member.filename.replace("\\", "/")
        place = PurePosixPath(name)
        if not place.parts or place.parts[0] == "__MACOSX":
            continue
        got = f"got {member.orig_filename!r}"
        if place.is_absolute() or ".." in place.parts or ":" in place.parts[0]:
            raise ValueError(f"{path} needs members inside its own folder, {got}")
        if _is_special(member, place):
            raise ValueError(f"{path} needs members that are files or folders, {got}")
        member.filename = f"{place}/" if name.endswith("/") else f"{place}"
        kept.append(member)
    return kept


def _is_special(member: zipfile.ZipInfo, place: PurePosixPath) -> bool:
    """Whether a member is a link, a pipe or a device, here or on Windows."""
    kind = stat.S_IFMT(member.external_attr >> 16)
    named = any(part.partition(".")[0].rstrip().upper() in DEVICES for part in place.parts)
    return named or kind not in (0, stat.S_IFREG, stat.S_IFDIR)
