"""Text of numbers: parsed all at once, or line by line where a fault is to be named."""

import codecs
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import pyarrow
from jaxtyping import Float64, Num
from pyarrow import csv

TYPES = {"real": pyarrow.float64(), "whole": pyarrow.int64()}
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
"""Neither ``nan`` nor ``1_000``, which ``float`` reads too."""
COUNT = re.compile(r"[0-9]{1,18}")
"""A number of lines or points, or of a file, that 64 bits hold."""
COMMENT = re.compile(rb"#(?<!\S#)[^\r\n]*")
"""From a ``#`` that begins a line or stands after a blank; within a word it is a fault.

It looks back from the ``#``, so that it is searched fast.
"""
QUOTED = 60
"""How much of a line is shown."""


class Line(NamedTuple):
    """A line of a file."""

    number: int
    """As an editor counts, from 1."""
    text: str


def read_lines(path: Path) -> list[Line]:
    """The lines of a file that are not blank.

    Raises:
        ValueError: The file is not in UTF-8.
    """
    return split_lines(path.read_bytes(), path)


def split_lines(content: bytes, path: Path, *, first: int = 1) -> list[Line]:
    """The lines that are not blank.

    Args:
        content: What the file holds, or its end.
        path: The file, for the message.
        first: The number of the first line.

    Raises:
        ValueError: It is not UTF-8.
    """
    lines = _decode(content, path, first).splitlines()
    return [Line(number, text) for number, text in enumerate(lines, first) if text.strip()]


def without_comments(content: bytes) -> bytes:
    """The same lines, each without the comment that it ends with, whatever its encoding."""
    return COMMENT.sub(b"", content.removeprefix(codecs.BOM_UTF8)) if b"#" in content else content


def _decode(content: bytes, path: Path, first: int) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise ValueError(f"{path} needs to be text in UTF-8, it begins as UTF-16 does")
    try:
        text = content.removeprefix(codecs.BOM_UTF8).decode("utf-8")
    except UnicodeDecodeError as error:
        before = error.object[: error.start]
        raise ValueError(
            f"{path}, line {first + before.count(10)}, needs to be text in UTF-8, got the byte "
            f"0x{error.object[error.start]:02x}: it may be in Latin-1"
        ) from error
    return text.replace("\r\n", "\n")


def check_width(lines: Sequence[Line], width: int, path: Path, form: str) -> None:
    """Refuse a line of more or fewer words than the others: it belongs to something else.

    Args:
        lines: The lines.
        width: How many words each needs.
        path: The file, for the message.
        form: What a line looks like, for the message: ``vertices `x y z```.

    Raises:
        ValueError: A line has another number of words.
    """
    for line in lines:
        found = len(line.text.split())
        if found != width:
            raise ValueError(
                f"{path}, line {line.number}, needs {form}, {width} numbers, got {found} in "
                f"{line.text.strip()[:QUOTED]!r}"
            )


def read_rows(
    lines: Sequence[Line],
    columns: Sequence[int],
    path: Path,
    form: str,
    separator: str | None = None,
) -> Float64[np.ndarray, "rows columns"]:
    """The numbers in some columns of each line.

    Args:
        lines: The lines.
        columns: Which columns, from 0.
        path: The file, for the message.
        form: What a line looks like, for the message: ``vertices `x y z```.
        separator: What stands between two columns; blanks if None.

    Raises:
        ValueError: A line has fewer columns, or one of them is no finite number.
    """
    if not lines:
        return np.zeros((0, len(columns)))
    texts = [line.text for line in lines]
    try:
        rows = np.loadtxt(texts, comments=None, delimiter=separator, usecols=columns, ndmin=2)
    except ValueError:
        rows = np.full((1, 1), np.nan)
    if np.isfinite(rows).all():
        return rows
    return np.array([_read_row(line, columns, path, form, separator) for line in lines])


def _read_row(
    line: Line, columns: Sequence[int], path: Path, form: str, separator: str | None
) -> list[float]:
    words = line.text.split(separator)
    if len(words) <= max(columns):
        raise ValueError(f"{path}, line {line.number}, needs {form}, got {line.text[:QUOTED]!r}")
    where = f"{path}, line {line.number},"
    return [read_number(words[column].strip(), where, form) for column in columns]


def read_number(word: str, where: str, form: str) -> float:
    """A finite number.

    Args:
        word: How it is written.
        where: The file and the line, for the message.
        form: What it belongs to, for the message: ``vertices `x y z```.

    Raises:
        ValueError: It is no number, or not finite.
    """
    number = float(word) if NUMBER.fullmatch(word) else math.nan
    if not math.isfinite(number):
        raise ValueError(f"{where} needs {form} of finite numbers, got {word[:QUOTED]!r}")
    return number


def parse_rows(
    text: bytes, num_rows: int, num_columns: int, kind: Literal["real", "whole"] = "real"
) -> Num[np.ndarray, "rows columns"] | None:
    """The numbers of a text of ``num_rows`` lines of ``num_columns`` numbers, blanks between.

    Arrow's parser rounds as ``float`` does, to the last bit, in a tenth of the time.

    Returns:
        None where the text is anything else; what it is then, is for a patient reader to find out.
    """
    if kind == "whole" and (b"x" in text or b"X" in text):  # Arrow would read 0x10 as 16
        return None
    rows = _parse(text, num_columns, kind)
    rows = _parse(_single_blanks(text), num_columns, kind) if rows is None else rows
    good = rows is not None and len(rows) == num_rows and np.isfinite(rows).all()
    return rows if good else None


def _parse(
    text: bytes, num_columns: int, kind: Literal["real", "whole"]
) -> Num[np.ndarray, "rows columns"] | None:
    """The numbers of lines with one blank between two of them; None where there is another."""
    names = [str(column) for column in range(num_columns)]
    try:
        lines = csv.open_csv(
            pyarrow.BufferReader(text),
            csv.ReadOptions(use_threads=False, column_names=names),
            csv.ParseOptions(delimiter=" ", quote_char=False, ignore_empty_lines=False),
            csv.ConvertOptions(column_types=dict.fromkeys(names, TYPES[kind]), null_values=[]),
        )
        table = lines.read_all()  # in this thread; `read_csv` hands over to one and waits
    except pyarrow.ArrowInvalid:
        return None
    columns = ([np.from_dlpack(part) for part in table[name].chunks] for name in names)
    return np.column_stack([np.concatenate(parts) for parts in columns])  # `to_numpy` loads pandas


def _single_blanks(text: bytes) -> bytes:
    """One blank between numbers, none about a line."""
    text = text.translate(bytes.maketrans(b"\t\r", b"  ")).strip()
    while b"  " in text:
        text = text.replace(b"  ", b" ")
    return text.replace(b" \n", b"\n").replace(b"\n ", b"\n")
