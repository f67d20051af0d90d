"""The place that everybody has: here."""

from pcrdiff.loops import Spread, in_turn


def test_items_are_done_in_their_order_and_not_before_they_are_asked_for() -> None:
    done: list[int] = []

    def note(item: int) -> int:
        done.append(item)
        return -item

    results = in_turn(note, range(5))
    assert isinstance(in_turn, Spread)
    assert done == []
    assert next(results) == 0
    assert done == [0]
    assert list(results) == [-1, -2, -3, -4]
