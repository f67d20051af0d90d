"""The poses that pairs are made with: their range and their spread."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.random_pose import PoseRange, draw_pose


def test_a_drawn_pose_has_angles_and_coordinates_in_its_range_and_fills_it() -> None:
    generator = np.random.default_rng(1)
    poses = np.stack(
        [draw_pose(PoseRange(math.pi / 4, 0.5), generator=generator) for _ in range(2000)]
    )
    angles = Rotation.from_matrix(poses[:, :3, :3]).as_euler("zyx", degrees=True)
    for values, most in ((angles, 45.0), (poses[:, :3, 3], 0.5)):
        assert values.min() >= 0
        assert values.max() <= most
        np.testing.assert_allclose(values.mean(axis=0), most / 2, rtol=0.05)
        np.testing.assert_allclose(values.std(axis=0), most / 12**0.5, rtol=0.05)
    assert (poses[:, 3] == [0, 0, 0, 1]).all()


def test_no_range_is_no_motion() -> None:
    np.testing.assert_array_equal(
        draw_pose(PoseRange(0.0, 0.0), generator=np.random.default_rng(0)), np.eye(4)
    )


def test_without_a_bound_rotations_are_uniform_over_all_there_are() -> None:
    generator = np.random.default_rng(2)
    poses = np.stack(
        [draw_pose(PoseRange(None, 0.5, -0.25), generator=generator) for _ in range(4000)]
    )
    rotations = Rotation.from_matrix(poses[:, :3, :3])
    mean_angle = math.pi / 2 + 2 / math.pi  # of the density (1 - cos a) / pi on [0, pi]
    np.testing.assert_allclose(rotations.magnitude().mean(), mean_angle, rtol=0.02)
    np.testing.assert_allclose(rotations.apply([0, 0, 1]).mean(axis=0), 0, atol=0.04)
    translations = poses[:, :3, 3]
    assert translations.min() >= -0.25
    np.testing.assert_allclose(translations.mean(axis=0), 0.125, atol=0.02)
