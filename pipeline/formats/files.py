"""Files that are written whole or not at all: bytes, JSON, CSV."""

import csv
import io
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


def write_atomically(path: Path, content: bytes) -> None:
    """Write ``path`` whole or not at all, making its folder if need be."""
    with written_beside(path) as file:
        file.write(content)


@contextmanager
def written_beside(path: Path) -> Iterator[BinaryIO]:
    """A file that becomes ``path`` when all is written, and goes where something is raised."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w+b") as file:
            yield file
        Path(name).chmod(0o644)  # mkstemp's own mode is 0600
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_json(path: Path, value: Mapping[str, object]) -> None:
    """Write a JSON object with sorted keys."""
    write_atomically(path, (json.dumps(value, indent=2, sort_keys=True) + "\n").encode())


def write_csv(path: Path, rows: Sequence[Sequence[object]]) -> None:
    """Write rows of fields, the header first."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_atomically(path, text.getvalue().encode())


def read_csv(file: Path) -> tuple[list[str], list[list[str]]]:
    """Read the header and the rows of a CSV file.

    Raises:
        ValueError: The file is empty, or ends or breaks off in the middle of a row.
    """
    text = file.read_text(encoding="utf-8")
    if not text.endswith("\n"):
        raise ValueError(f"{file} needs a whole last line, it is empty or cut short")
    header, *rows = csv.reader(text.splitlines(keepends=True))
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise ValueError(
                f"{file} needs {len(header)} fields a row, row {number} has {len(row)}"
            )
    return header, rows
