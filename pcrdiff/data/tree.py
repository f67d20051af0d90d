"""Listing folders so that nothing which cannot be listed is passed over in silence."""

import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path


def entries(folder: Path) -> list[Path]:
    """What a folder holds, by name; ``Path.glob`` would take one that cannot be read for empty.

    Raises:
        OSError: The folder cannot be listed: no permission, an input error, a stale mount. The
            sentence names it.
        ValueError: A name in it is not in UTF-8, so no manifest and no pair file can hold it.
    """
    try:
        found = sorted(folder.iterdir())
    except OSError as error:
        raise type(error)(f"{folder} cannot be listed: {error.strerror or error}") from error
    for path in found:
        if not _is_utf8(path.name):
            raise ValueError(
                f"{folder} needs names in UTF-8, it holds {os.fsencode(path.name)!r}: it may be in "
                "Latin-1"
            )
    return found


def _is_utf8(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:  # bytes that are no UTF-8 come as lone surrogates
        return False
    return True


def walk_files(folder: Path) -> Iterator[Path]:
    """Every file below a folder, links followed; each real folder is entered once.

    Raises:
        OSError: As for ``entries``, for any folder below; or a file vanished meanwhile.
    """
    seen: set[tuple[int, int]] = set()
    waiting = [folder]
    while waiting:
        place = waiting.pop()
        status = place.stat()
        if (status.st_dev, status.st_ino) in seen:
            continue
        seen.add((status.st_dev, status.st_ino))
        for path in entries(place):
            mode = _mode(path)
            if stat.S_ISDIR(mode):
                waiting.append(path)
            elif stat.S_ISREG(mode):
                yield path


def _mode(path: Path) -> int:
    """The mode of what a path leads to; 0 for a link that leads nowhere."""
    try:
        return path.stat().st_mode
    except OSError as error:
        if error.errno in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP) and path.is_symlink():
            return 0
        raise type(error)(f"{path} cannot be read: {error.strerror or error}") from error
