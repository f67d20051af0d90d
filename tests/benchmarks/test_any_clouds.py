"""The table of ``pcrdiff.register``: what counts as right, and as trusted."""

import numpy as np
import pytest

from benchmarks.any_clouds import Case, tabulate
from tests.pcrdiff.test_any_clouds import crops


def test_the_error_is_the_displacement_of_the_source_and_none_is_right_of_different_things() -> (
    None
):
    source, target, T = crops()
    moved = T.copy()
    moved[:3, 3] += [3.0, 0.0, 4.0]
    assert Case("", source, target, T).error(moved) == pytest.approx(5.0)
    assert Case("", source, target, None).error(T) == float("inf")


def test_each_kind_has_a_line_with_its_share_of_right_answers() -> None:
    source, target, T = crops()
    sphere = np.random.default_rng(0).normal(size=(800, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    cases = [Case("crops", source, target, T), Case("different", source, sphere, None)]
    head, *lines = tabulate(cases)
    assert head.split()[:2] == ["pairs", "right"]
    rows = {line.split()[0]: [float(word) for word in line.split()[1:5]] for line in lines}
    assert rows == {"crops": [1, 100, 100, 0], "different": [1, 0, 0, 0]}
