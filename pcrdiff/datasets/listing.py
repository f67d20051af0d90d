"""Listing folders: nothing unreadable is passed over, and only a data set's own names are accepted."""

import errno
import os
import re
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

LITTER = re.compile(
    r"[.#].*|__.*|.*(~|\.bak|\.swp)|Thumbs\.db|desktop\.ini|lost\+found|\$RECYCLE\.BIN"
    r"|System Volume Information",
    re.DOTALL | re.IGNORECASE,
)
"""What systems and editors leave beside the files of people."""
NAMED = 5
"""Names that a sentence quotes before it only counts them."""


@contextmanager
def naming(path: Path, done: str) -> Iterator[None]:
    """Let an error of the system name its path: what cannot be ``done`` with it, and why.

    Raises:
        OSError: Of the same kind as the one that was raised.
    """
    try:
        yield
    except OSError as error:
        raise type(error)(f"{path} cannot be {done}: {error.strerror or error}") from error


def entries(folder: Path) -> list[Path]:
    """What a folder holds, by name; ``Path.glob`` would take one that cannot be read for empty.

    Raises:
        OSError: The folder cannot be listed: no permission, an input error, a stale mount. The
            sentence names it.
        ValueError: A name in it is not in UTF-8, so no manifest and no pair file can hold it.
    """
    with naming(folder, "listed"):
        found = sorted(folder.iterdir())
    for path in found:
        try:
            path.name.encode()
        except UnicodeEncodeError as error:  # bytes that are no UTF-8 come as lone surrogates
            raise ValueError(
                f"{folder} needs names in UTF-8, it holds {os.fsencode(path.name)!r}: it may be in "
                "Latin-1"
            ) from error
    return found


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
    with naming(path, "read"):
        try:
            return path.stat().st_mode
        except OSError as error:
            if error.errno in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP) and path.is_symlink():
                return 0
            raise


def list_folders(folder: Path) -> list[Path]:
    """The folders right below one, by name, but for what systems leave there.

    Raises:
        OSError: The folder cannot be listed, or what an entry is cannot be found out: a link that
            leads nowhere, no permission. What it stood for would be missed.
    """
    found = [entry for entry in entries(folder) if not LITTER.fullmatch(entry.name)]
    folders = []
    for entry in found:
        with naming(entry, "read"):  # Path.is_dir would take one that cannot be for no folder
            if stat.S_ISDIR(entry.stat().st_mode):
                folders.append(entry)
    return folders


def list_files(folder: Path, ending: str) -> list[Path]:
    """The files whose names hold ``ending`` in whatever case, so the misnamed ones among them.

    Raises:
        OSError: The folder cannot be listed.
    """
    return [
        entry
        for entry in entries(folder)
        if ending in entry.name.casefold() and not LITTER.fullmatch(entry.name)
    ]


def check_names(paths: Sequence[Path], pattern: str, official: str) -> None:
    """Refuse names that are not the data set's own: a copy would count as an item of its own.

    Args:
        paths: Files or folders that lie in one folder.
        pattern: A regular expression for the whole name.
        official: How such a name looks, for the message.

    Raises:
        ValueError: A name is not like that; the sentence quotes it.
    """
    wrong = [path for path in paths if not re.fullmatch(pattern, path.name)]
    if wrong:
        quoted = ", ".join(repr(path.name) for path in wrong[:NAMED])
        more = f" and {len(wrong) - NAMED} more" if len(wrong) > NAMED else ""
        raise ValueError(
            f"{wrong[0].parent} needs names like {official}, got {quoted}{more}: "
            "rename or remove what is no part of the data set"
        )


def refuse_several(candidates: Sequence[tuple[Path, str]], root: Path) -> None:
    """Refuse to choose among data sets; links to the same folder count once.

    Args:
        candidates: Folders that hold one, and in words which.
        root: Where they were looked for, for the message.

    Raises:
        ValueError: There are several; the sentence lists them.
    """
    distinct: dict[tuple[Path, str], Path] = {}
    for folder, what in candidates:
        distinct.setdefault((folder.resolve(), what), folder)
    if len(distinct) > 1:
        listed = "; ".join(f"{what} in {folder}" for (_, what), folder in distinct.items())
        raise ValueError(
            f"{root} needs to hold one data set in one layout, it holds {len(distinct)}: {listed}; "
            "give a folder that holds only the one that is meant"
        )
