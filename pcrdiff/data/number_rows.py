"""Rows of numbers in text, parsed all at once: what takes longest in reading a mesh."""

import numpy as np
from jaxtyping import Bool, Float64, Int64, UInt8, UInt64

Characters = UInt8[np.ndarray, " bytes"]
Places = Int64[np.ndarray, " numbers"]
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


def parse_rows(
    text: bytes, num_rows: int, num_columns: int, made_of: bytes = REALS
) -> Float64[np.ndarray, "rows columns"] | None:
    """The numbers of a text of ``num_rows`` lines of ``num_columns`` numbers, blanks between.

    The same values, to the last bit, as Python's ``float`` gives.

    Returns:
        None where the text is anything else; what it is then, is for a patient reader to find out.
    """
    if text.translate(None, BLANKS + made_of):
        return None
    characters = np.frombuffer(b" " * WORD + text.removesuffix(b"\n"), np.uint8)
    starts, ends = _find_numbers(characters)
    line_ends = np.flatnonzero(characters == ord("\n"))
    if len(starts) != num_rows * num_columns or len(line_ends) != num_rows - 1:
        return None
    first, last = starts[::num_columns], starts[num_columns - 1 :: num_columns]
    if (last[:-1] > line_ends).any() or (first[1:] < line_ends).any():
        return None
    try:
        return _parse(characters, starts, ends).reshape(num_rows, num_columns)
    except ValueError:
        return None


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
    points = _find_points(characters, ends)
    decimals = np.maximum(ends - points - 1, 0)
    digits = points - starts - negative + decimals
    known = (digits > 0) & (digits <= MOST_DIGITS)
    decimals[~known] = 0
    whole, is_whole = _parse_digits(characters, points, digits - decimals)
    if decimals.any():
        fraction, is_fraction = _parse_digits(characters, ends, decimals)
        whole, is_whole = whole * TENS[decimals] + fraction, is_whole & is_fraction
    numbers: Float64[np.ndarray, " numbers"] = whole / TENS[decimals].astype(np.float64)
    known &= is_whole
    long = np.flatnonzero(known & (digits > EXACT_DIGITS))
    if len(long):
        numbers[long], known[long] = _divide(whole[long], TENS[decimals[long]])
    numbers = np.where(negative, -numbers, numbers)
    others, text = np.flatnonzero(~known), characters.tobytes()
    places = zip(starts[others].tolist(), ends[others].tolist(), strict=True)
    numbers[others] = [float(text[start:end]) for start, end in places]
    return numbers


def _find_points(characters: Characters, ends: Places) -> Places:
    """The decimal point of each number; its end where it has none."""
    points = np.flatnonzero(characters == ord("."))
    if len(points) == len(ends) and (points < ends).all() and (points[1:] > ends[:-1]).all():
        return points
    found = ends.copy()
    found[np.searchsorted(ends, points)] = points
    return found


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
    longest = min(int(lengths.max()), MOST_DIGITS)
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
