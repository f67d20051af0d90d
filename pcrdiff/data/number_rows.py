"""Rows of numbers in text, parsed all at once: what takes longest in reading a mesh."""

import warnings

import numpy as np
from jaxtyping import Float64, Int64, UInt8

Characters = UInt8[np.ndarray, " bytes"]
Places = Int64[np.ndarray, " numbers"]
BLANKS, DIGITS, REALS = b" \t\r\n", b"-0123456789", b"+-.0123456789eE"
"""What there is between numbers, and what whole numbers and others are made of."""
EXACT_DIGITS = 15
"""As many make a whole number that float64 holds exactly, and so do powers of ten up to 10^22."""
WORD = 8
"""Bytes that are parsed at once."""


def parse_rows(
    text: bytes, num_rows: int, num_columns: int, made_of: bytes = REALS
) -> Float64[np.ndarray, "rows columns"] | None:
    """The numbers of a text of ``num_rows`` lines of ``num_columns`` numbers, blanks between.

    The same values, to the last bit, as a correctly rounding ``strtod`` gives: up to 15 digits make
    an exact whole number, divided once by an exact power of ten (Clinger 1990).

    Returns:
        None where the text is anything else; what it is then, is for a patient reader to find out.
    """
    if text.translate(None, BLANKS + made_of):
        return None
    characters = np.frombuffer(b" " * WORD + text, np.uint8)
    starts, ends = _find_numbers(characters)
    line_ends = np.flatnonzero(characters == ord("\n"))
    if len(starts) != num_rows * num_columns or len(line_ends) not in (num_rows - 1, num_rows):
        return None
    first, last = starts[::num_columns], starts[num_columns - 1 :: num_columns]
    between = line_ends[: num_rows - 1]
    if (last[:-1] > between).any() or (first[1:] < between).any():
        return None
    numbers = _parse_decimals(characters, starts, ends)
    numbers = _parse_any(text, len(starts)) if numbers is None else numbers
    return None if numbers is None else numbers.reshape(num_rows, num_columns)


def _find_numbers(characters: Characters) -> tuple[Places, Places]:
    """Where each number starts, and where the blank after it is."""
    is_number = np.zeros(len(characters) + 2, bool)
    np.greater(characters, ord(" "), out=is_number[1:-1])
    edges = np.flatnonzero(is_number[1:] != is_number[:-1])
    return edges[::2], edges[1::2]


def _parse_decimals(
    characters: Characters, starts: Places, ends: Places
) -> Float64[np.ndarray, " numbers"] | None:
    """Numbers like ``12``, ``-0.5`` and ``3.``; None if one is not, or has too many digits."""
    negative = characters[starts] == ord("-")
    starts, points = starts + negative, np.flatnonzero(characters == ord("."))
    if len(points) == 0:
        digits = ends - starts
        fits = digits.min() > 0 and digits.max() <= EXACT_DIGITS
        numbers = _parse_digits(characters, ends, digits) if fits else None
    else:
        numbers = _parse_fractions(characters, starts, _points_of(ends, points), ends)
    return None if numbers is None else np.where(negative, -numbers, numbers)


def _points_of(ends: Places, points: Places) -> Places:
    """The decimal point of each number; its end where it has none."""
    if len(points) == len(ends) and (points < ends).all() and (points[1:] > ends[:-1]).all():
        return points
    found = ends.copy()
    found[np.searchsorted(ends, points)] = points
    return found


def _parse_fractions(
    characters: Characters, starts: Places, points: Places, ends: Places
) -> Float64[np.ndarray, " numbers"] | None:
    decimals = np.maximum(ends - points - 1, 0)
    digits = points - starts + decimals
    if digits.min() < 1 or digits.max() > EXACT_DIGITS:
        return None
    whole = _parse_digits(characters, points, points - starts)
    fraction = _parse_digits(characters, ends, decimals)
    if whole is None or fraction is None:
        return None
    scale = (10.0 ** np.arange(EXACT_DIGITS + 1))[decimals]
    numbers: Float64[np.ndarray, " numbers"] = (whole * scale + fraction) / scale
    return numbers


def _parse_digits(
    characters: Characters, ends: Places, lengths: Places
) -> Float64[np.ndarray, " numbers"] | None:
    """Whole numbers by their last digits, 16 at most; none is 0; None if one is no digit."""
    last = _parse_word(characters, ends, np.minimum(lengths, WORD))
    if last is None or lengths.max() <= WORD:
        return last
    first = _parse_word(characters, np.maximum(ends - WORD, WORD), np.maximum(lengths - WORD, 0))
    return None if first is None else np.add(first * 10.0**WORD, last)


def _parse_word(
    characters: Characters, ends: Places, lengths: Places
) -> Float64[np.ndarray, " numbers"] | None:
    """Eight digits or fewer at once, as bytes of a word that are paired up three times."""
    words = np.ndarray(len(characters) - WORD + 1, "<u8", characters, strides=(1,))
    used = np.array([((1 << 8 * n) - 1) << 8 * (WORD - n) for n in range(WORD + 1)], np.uint64)
    word = (words[ends - WORD] ^ np.uint64(0x3030303030303030)) & used[lengths]
    if ((word + np.uint64(0x7676767676767676)) & np.uint64(0x8080808080808080)).any():
        return None  # a byte above 9
    for bits, pairs in ((8, 0x00FF00FF00FF00FF), (16, 0x0000FFFF0000FFFF), (32, 0xFFFFFFFF)):
        tens = word * np.uint64(10 ** (bits // 8))
        word = (tens + (word >> np.uint64(bits))) & np.uint64(pairs)
    numbers: Float64[np.ndarray, " numbers"] = word.astype(np.float64)
    return numbers


def _parse_any(text: bytes, count: int) -> Float64[np.ndarray, " numbers"] | None:
    """Numbers with exponents or many digits."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # that it stopped where no number was
        try:
            numbers = np.fromstring(text, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    return numbers if len(numbers) == count else None
