"""What is said where a library's answer is none."""

from typing import Any

import numpy as np
import pytest

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import check_matches, cloud, registration
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, seeded, small_pose

POSE = small_pose(20, (0.1, 0.2, 0.3)).numpy()


def answer(matches: list[tuple[int, int]], pose: np.ndarray) -> Any:  # noqa: ANN401  Open3D's
    result = registration.RegistrationResult()
    result.correspondence_set = open3d.utility.Vector2iVector(np.array(matches).reshape(-1, 2))
    result.transformation = pose
    return result


def test_the_matches_that_open3d_tells_are_counted_on_both_sides() -> None:
    p = cloud(lopsided_clouds(1, 20, generator=seeded(0))[0])
    good = [(k, k) for k in range(5)]
    assert (check_matches("x", p, p, answer(good, POSE), 0.5).numpy() == POSE).all()
    for matches in ([(k, 1) for k in range(5)], [(1, k) for k in range(5)]):
        with pytest.raises(ValueError, match=r"^x needs 3 matches within 0\.5, got 1$"):
            check_matches("x", p, p, answer(matches, POSE), 0.5)
    with pytest.raises(ValueError, match=r"^x needs 3 matches within 0\.5, got 0$"):
        check_matches("x", p, p, answer([], POSE), 0.5)
