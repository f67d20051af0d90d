"""What is said where a library's answer is none."""

from typing import Any

import numpy as np
import pytest

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import (
    check_matches,
    check_pose,
    check_support,
    cloud,
    registration,
)
from tests.pcrdiff.made_up_clouds import lopsided_clouds, seeded, small_pose

POINTS = lopsided_clouds(1, 20, generator=seeded(0))[0].double().numpy()
COPIES, PAIR = [3, 3, 3], [3, 4, 3, 4, 4]
POSE = small_pose(20, (0.1, 0.2, 0.3)).numpy()


@pytest.mark.parametrize(
    ("chosen", "distinct"), [([], 0), ([7], 1), (COPIES, 1), (PAIR, 2)], ids=str
)
def test_copies_of_a_point_support_a_pose_once(chosen: list[int], distinct: int) -> None:
    others = list(range(len(chosen)))
    said = f"^x needs 3 matches within 1, got {distinct}$"
    for sides in ((chosen, others), (others, chosen)):
        with pytest.raises(ValueError, match=said):
            check_support("x", POINTS[sides[0]], POINTS[sides[1]], "within 1")


def test_points_on_one_line_support_no_pose() -> None:
    line = np.linspace(0, 1, 20)[:, None] * [[1.0, 2.0, 3.0]] + 5
    for source, target in ((line, POINTS), (POINTS, line)):
        with pytest.raises(ValueError, match=r"^x needs 3 matches within 1 on no line, got 20 on"):
            check_support("x", source, target, "within 1")


def test_three_points_off_a_line_and_flat_ones_support_a_pose() -> None:
    check_support("x", POINTS[:3], POINTS[3:6], "within 1")
    check_support("x", POINTS * [1, 1, 0], POINTS * [0, 1, 1], "within 1")


def answer(matches: list[tuple[int, int]], pose: np.ndarray) -> Any:  # noqa: ANN401  Open3D's
    result = registration.RegistrationResult()
    result.correspondence_set = open3d.utility.Vector2iVector(np.array(matches).reshape(-1, 2))
    result.transformation = pose
    return result


def test_the_matches_that_open3d_tells_are_counted_on_both_sides() -> None:
    p = cloud(lopsided_clouds(1, 20, generator=seeded(0))[0])
    good = [(k, k) for k in range(5)]
    assert (check_matches("x", p, p, answer(good, POSE), 0.5) == POSE).all()
    for matches in ([(k, 1) for k in range(5)], [(1, k) for k in range(5)]):
        with pytest.raises(ValueError, match=r"^x needs 3 matches within 0\.5, got 1$"):
            check_matches("x", p, p, answer(matches, POSE), 0.5)
    with pytest.raises(ValueError, match=r"^x needs 3 matches within 0\.5, got 0$"):
        check_matches("x", p, p, answer([], POSE), 0.5)


@pytest.mark.parametrize(
    "broken",
    [
        np.full((4, 4), np.nan),
        np.where(np.eye(4) == 1, POSE, np.inf),
        POSE @ np.diag([1.0, 1.0, -1.0, 1.0]),
        POSE @ np.diag([1.1, 1.0, 1.0, 1.0]),
        np.zeros((4, 4)),
        np.vstack([POSE[:3], [[0.0, 0.0, 0.1, 1.0]]]),
    ],
    ids=["nan", "infinite", "reflection", "stretched", "zeros", "projective"],
)
def test_what_is_no_rigid_pose_is_refused(broken: np.ndarray) -> None:
    assert check_pose("x", POSE) is POSE
    with pytest.raises(ValueError, match=r"^x needs a rigid pose from its library, got \[\["):
        check_pose("x", broken)
