"""Rows of numbers in text, parsed all at once: what takes longest in reading a mesh."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8, UInt64

Characters = UInt8[np.ndarray, " bytes"]
Places = Int64[np.ndarray, " numbers"]
Wholes = UInt64[np.ndarray, " numbers"]
Known = Bool[np.ndarray, " numbers"]
Table = Float64[np.ndarray, "rows columns"]
BLANKS, DIGITS, REALS = b" \t\r\n", b"-0123456789", b"+-.0123456789eE"
"""What there is between numbers, and what whole numbers and others are made of."""
WORD = 8
"""Bytes that are parsed at once."""
USED = np.array([((1 << 8 * n) - 1) << 8 * (WORD - n) for n in range(WORD + 1)], np.uint64)
"""The bits of a word in which its last bytes lie, by how many of them are meant."""
EXACT_DIGITS, MOST_DIGITS = 15, 19
"""As many make a whole number that float64 holds exactly, and one that 64 bits do."""
TENS = np.array([10**n for n in range(MOST_DIGITS + 1)], np.uint64)
HAS_64_BITS = np.finfo(np.longdouble).nmant == 63
"""Whether ``longdouble`` is x86's, which holds any 64-bit whole number."""


def parse_rows(text: bytes, tables: Sequence[tuple[int, int]]) -> list[Table] | None:
    """The numbers of tables that follow each other: so many lines, so many numbers a line.

    The same values, to the last bit, as Python's ``float`` gives.

    Returns:
        None where the text is anything else; what it is then, is for a patient reader to find out.
    """
    if text.translate(None, BLANKS + REALS):
        return None
    characters = np.frombuffer(b" " * WORD + text + b"\n", np.uint8)
    starts, ends = _find_numbers(characters)
    line_ends = np.flatnonzero(characters == ord("\n"))
    if not _lie_in_rows(starts, line_ends, tables):
        return None
    try:
        numbers = _parse(characters, starts, ends)
    except ValueError:
        return None
    cuts = np.cumsum([rows * columns for rows, columns in tables])[:-1]
    parts = zip(np.split(numbers, cuts), tables, strict=True)
    return [part.reshape(shape) for part, shape in parts]


def _lie_in_rows(
    starts: Places, line_ends: Int64[np.ndarray, " lines"], tables: Sequence[tuple[int, int]]
) -> bool:
    """Whether each line has as many numbers as its table has columns, and there is no more."""
    total, lines = sum(rows * columns for rows, columns in tables), sum(r for r, _ in tables)
    if len(starts) != total or len(line_ends) != lines:
        return False
    per_line = np.repeat([columns for _, columns in tables], [rows for rows, _ in tables])
    last = per_line.cumsum() - 1
    first = starts[last[:-1] + 1]
    return not ((starts[last] > line_ends).any() or (first < line_ends[:-1]).any())


def _find_numbers(characters: Characters) -> tuple[Places, Places]:
    """Where each number starts, and where the blank after it is."""
    is_number = np.zeros(len(characters) + 2, bool)
    np.greater(characters, ord(" "), out=is_number[1:-1])
    edges = np.flatnonzero(is_number[1:] != is_number[:-1])
    return edges[::2], edges[1::2]


def _parse(characters: Characters, starts: Places, ends: Places) -> Float64[np.ndarray, " numbers"]:
    """Numbers like ``12``, ``-0.5`` and ``3.`` all at once, others one by one.

    A whole number is divided by a power of ten, both held exactly, so that it is rounded once
    (Clinger 1990).

    Raises:
        ValueError: One is no number.
    """
    negative = characters[starts] == ord("-")
    broken, points = _find_points(characters, ends)
    whole_ends = ends.copy()
    whole_ends[broken] = points
    lengths = whole_ends - starts - negative
    whole, known = _parse_digits(characters, whole_ends, lengths)
    known &= (lengths > 0) & (lengths <= MOST_DIGITS)
    numbers = whole.astype(np.float64)
    decimals = ends[broken] - points - 1
    numbers[broken], known[broken] = _add_decimals(
        characters, (whole[broken], lengths[broken], known[broken]), ends[broken], decimals
    )
    numbers = np.where(negative, -numbers, numbers)
    others = np.flatnonzero(~known)
    if len(others):
        text, places = characters.tobytes(), zip(starts[others], ends[others], strict=True)
        numbers[others] = [float(text[start:end]) for start, end in places]
    return numbers


def _find_points(
    characters: Characters, ends: Places
) -> tuple[Int64[np.ndarray, " broken"], Int64[np.ndarray, " broken"]]:
    """Which numbers have a decimal point, and where; of several points in one the last."""
    points = np.flatnonzero(characters == ord("."))
    numbers = np.searchsorted(ends, points)
    last = np.append(numbers[1:] != numbers[:-1], True)[: len(points)]
    return numbers[last], points[last]


def _add_decimals(
    characters: Characters,
    before: tuple[Wholes, Places, Known],
    ends: Places,
    decimals: Places,
) -> tuple[Float64[np.ndarray, " numbers"], Known]:
    """Numbers of what stands before their point (value, digits, whether known) and after it."""
    whole, lengths, known = before
    fits = (lengths + decimals > 0) & (lengths + decimals <= MOST_DIGITS)
    tens = TENS.take(np.where(fits, decimals, 0))
    fraction, is_fraction = _parse_digits(characters, ends, decimals)
    whole = whole * tens + fraction
    known = fits & is_fraction & (known | (lengths == 0))
    numbers = whole / tens.astype(np.float64)
    long = np.flatnonzero(known & (lengths + decimals > EXACT_DIGITS))
    if len(long):
        numbers[long], known[long] = _divide(whole[long], tens[long])
    return numbers, known


def _divide(
    whole: UInt64[np.ndarray, " numbers"], tens: UInt64[np.ndarray, " numbers"]
) -> tuple[Float64[np.ndarray, " numbers"], Bool[np.ndarray, " numbers"]]:
    """Quotients, and whether they are sure: rounded to 64 bits first, not half way between two."""
    quotient = whole.astype(np.longdouble) / tens.astype(np.longdouble)
    rounded = quotient.astype(np.float64)
    step = np.spacing(np.nextafter(rounded, 0))
    sure = np.abs((quotient - rounded).astype(np.float64)) < 0.499 * step
    return rounded, (sure | (rounded == 0)) & HAS_64_BITS


def _parse_digits(
    characters: Characters, ends: Places, lengths: Places
) -> tuple[UInt64[np.ndarray, " numbers"], Bool[np.ndarray, " numbers"]]:
    """Whole numbers by their last digits, and whether they are digits; none is 0."""
    total, good = _parse_word(characters, ends, np.clip(lengths, 0, WORD))
    longest = min(int(lengths.max(initial=0)), MOST_DIGITS)
    for done in range(WORD, longest, WORD):
        places = np.maximum(ends - done, WORD)
        more, fine = _parse_word(characters, places, np.clip(lengths - done, 0, WORD))
        total, good = total + more * TENS[done], good & fine
    return total, good


def _parse_word(
    characters: Characters, ends: Places, lengths: Places
) -> tuple[UInt64[np.ndarray, " numbers"], Bool[np.ndarray, " numbers"]]:
    """Eight digits or fewer at once, as bytes of a word that are paired up three times."""
    words = np.ndarray(len(characters) - WORD + 1, "<u8", characters, strides=(1,))
    word = (words[ends - WORD] ^ np.uint64(0x3030303030303030)) & USED.take(lengths)
    above_9 = (word + np.uint64(0x7676767676767676)) & np.uint64(0x8080808080808080)
    for bits, pairs in ((8, 0x00FF00FF00FF00FF), (16, 0x0000FFFF0000FFFF), (32, 0xFFFFFFFF)):
        tens = word * np.uint64(10 ** (bits // 8))
        word = (tens + (word >> np.uint64(bits))) & np.uint64(pairs)
    return word, above_9 == 0
