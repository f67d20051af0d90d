"""The poses that pairs are made with: their range and their spread."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.random_pose import draw_pose


def test_a_drawn_pose_has_angles_and_coordinates_in_its_range_and_fills_it() -> None:
    generator = np.random.default_rng(1)
    poses = np.stack([draw_pose(math.pi / 4, 0.5, generator=generator) for _ in range(2000)])
    angles = Rotation.from_matrix(poses[:, :3, :3]).as_euler("zyx", degrees=True)
    for values, most in ((angles, 45.0), (poses[:, :3, 3], 0.5)):
        assert values.min() >= 0
        assert values.max() <= most
        np.testing.assert_allclose(values.mean(axis=0), most / 2, rtol=0.05)
        np.testing.assert_allclose(values.std(axis=0), most / 12**0.5, rtol=0.05)
    assert (poses[:, 3] == [0, 0, 0, 1]).all()


def test_no_range_is_no_motion() -> None:
    np.testing.assert_array_equal(
        draw_pose(0.0, 0.0, generator=np.random.default_rng(0)), np.eye(4)
    )
