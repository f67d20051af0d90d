"""Which points fix a pose."""

import numpy as np
import pytest
import torch

from pcrdiff.geometry.rigid import transform
from pcrdiff.geometry.span import check_support, spans_plane
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded

ALONG = np.linspace(-1, 1, 50)[:, None]
SPREAD = np.random.default_rng(0).normal(size=(50, 3))


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.eye(3)[:2],
        np.ones((50, 3)),
        np.eye(3)[[0, 1] * 25],
        ALONG * [0.3, -0.2, 0.1],
        ALONG * [0.3, -0.2, 0.1] + 7,
        ALONG * [0.3, -0.2, 0.1] + 1e-9 * SPREAD,
    ],
    ids=["none", "two", "one again", "two again", "line", "line aside", "line but for rounding"],
)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_point_two_points_and_a_line_span_no_plane_wherever_they_lie(
    points: np.ndarray, dtype: type
) -> None:
    assert not spans_plane(points.astype(dtype))
    for pose in random_poses(5, generator=seeded(0)):
        moved = transform(pose, torch.from_numpy(points)).numpy()
        assert not spans_plane(moved.astype(dtype))


@pytest.mark.parametrize(
    "points",
    [np.eye(3), SPREAD * [1, 1, 0], SPREAD * [1, 1e-3, 0], SPREAD, SPREAD * 1e-9, SPREAD + 100],
    ids=["triangle", "flat", "strip", "full", "tiny", "aside"],
)
def test_a_flat_cloud_spans_one_whatever_its_size(points: np.ndarray) -> None:
    assert spans_plane(points)


POINTS = lopsided_clouds(1, 20, generator=seeded(0))[0].double().numpy()
COPIES, PAIR = [3, 3, 3], [3, 4, 3, 4, 4]


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
