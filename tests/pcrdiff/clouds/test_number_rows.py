"""Rows of numbers, parsed all at once, are what ``float`` reads one by one."""

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcrdiff.clouds.number_rows import parse_rows

ROW = ["0", "-0", "0.0", "-0.5", "3.", ".25", "12345678", "123456789012345", "1e-5", "-1E+3"]
WRITTEN = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.floats(-1e6, 1e6).map(lambda x: f"{x:.6f}"),
    st.floats(-1e6, 1e6).map(lambda x: f"{x:.17g}"),
    st.floats(-1, 1).map(lambda x: f"{x:.19f}"),
    st.integers(-(10**21), 10**21).map(str),
)


def parsed(text: str, rows: int, columns: int) -> list[list[float]] | None:
    found = parse_rows(text.encode(), rows, columns)
    return None if found is None else found.tolist()


def same(found: float, text: str) -> bool:
    """To the last bit, and the sign of zero."""
    return np.float64(found).tobytes() == np.float64(float(text)).tobytes()


@given(numbers=st.lists(WRITTEN, min_size=1, max_size=30))
def test_every_number_is_what_float_reads(numbers: list[str]) -> None:
    found = parsed(" ".join(numbers), 1, len(numbers))
    assert found is not None
    assert all(same(x, text) for x, text in zip(found[0], numbers, strict=True))


def test_numbers_half_way_between_two_are_rounded_as_float_rounds_them() -> None:
    generator = np.random.default_rng(0)
    texts = []
    for whole in generator.integers(2**52, 2**53, 500).tolist():
        number = whole / 4  # sixteen or seventeen digits with the half
        middle = (Decimal(number) + Decimal(float(np.nextafter(number, np.inf)))) / 2
        texts.append(str(middle))
    found = parsed("\n".join(texts), len(texts), 1)
    assert found is not None
    assert all(same(x, text) for (x,), text in zip(found, texts, strict=True))


def test_every_way_of_writing_one_number_is_read() -> None:
    found = parsed("\t".join(ROW) + " \r\n", 1, len(ROW))
    assert found is not None
    assert all(same(x, text) for x, text in zip(found[0], ROW, strict=True))


def test_rows_are_lines() -> None:
    assert parsed("1 2 3\n 4 5  6", 2, 3) == [[1, 2, 3], [4, 5, 6]]
    assert parsed("1 2 3\n4 5 6\n", 2, 3) == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3 4\n5 6", "1 2\n3 4 5 6", "1 2 3\n\n4 5 6", "1 2 3\n4 5", "1 2 3\n4 5 6\n7",
        "1 2 3 4 5 6", "", "1 2 3\n4 5 x", "1 2 3\n4 5 nan", "1 2 3\n4 5 1.2.3", "1 2 3\n4 5 -",
        "1 2 3\n4 5 1-2", "1 2 3\n4 5 --1", "1 2 3\n4 5 .", "1 2 3\n4 5 1e", "1 2 3\n4 5 1e5.0",
    ],
)  # fmt: skip
def test_anything_else_is_left_to_a_patient_reader(text: str) -> None:
    assert parsed(text, 2, 3) is None


@pytest.mark.parametrize("text", ["1.0", "1e2", "+1"])
def test_whole_numbers_have_nothing_but_digits_and_a_sign(text: str) -> None:
    assert parse_rows(text.encode(), 1, 1, "whole") is None
    assert parse_rows(b"-12", 1, 1, "whole") == [[-12]]
