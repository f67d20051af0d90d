"""Which points fix a pose."""

import numpy as np
import pytest
import torch

from pcrdiff.geometry.rigid import transform
from pcrdiff.geometry.span import spans_plane
from tests.pcrdiff.made_up_clouds import random_poses, seeded

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
