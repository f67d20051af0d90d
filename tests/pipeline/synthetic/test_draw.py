"""Draws keep within their bounds, come from their generator alone, and reach every option."""

import numpy as np

from pipeline.synthetic.draw import Draw


def draws(seed: int) -> list[object]:
    draw = Draw(np.random.default_rng(seed))
    return [draw(2, 3), draw.whole(1, 9), draw.pick("abcdef"), draw.chance(0.5), draw.maybe(0.5, 1)]


def test_the_same_generator_draws_the_same() -> None:
    assert draws(1) == draws(1)
    assert draws(1) != draws(2)


def test_sizes_and_numbers_keep_within_their_bounds_and_reach_them() -> None:
    draw = Draw(np.random.default_rng(0))
    sizes = [draw(2, 3) for _ in range(200)]
    assert 2 <= min(sizes) < 2.1
    assert 2.9 < max(sizes) <= 3
    assert {draw.whole(1, 3) for _ in range(100)} == {1, 2, 3}
    assert {draw.pick("abc") for _ in range(100)} == {"a", "b", "c"}


def test_a_share_is_the_share_of_the_draws() -> None:
    draw = Draw(np.random.default_rng(0))
    assert 0.25 < np.mean([draw.chance(0.3) for _ in range(1000)]) < 0.35
    assert 0.25 < np.mean([draw.maybe(0.3, "x", "y") == ("x", "y") for _ in range(1000)]) < 0.35
    assert draw.maybe(0.0, "x") == ()
