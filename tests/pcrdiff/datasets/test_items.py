"""Poses that a data set records are rigid, or refused."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcrdiff.datasets.items import check_rigid


def make_pose(angle_deg: float = 40.0) -> np.ndarray:
    T_target_source = np.eye(4)
    T_target_source[:3, :3] = Rotation.from_euler("xyz", [angle_deg, 20, 10], True).as_matrix()
    T_target_source[:3, 3] = [1.0, -2.0, 3.0]
    return T_target_source


def test_keeps_an_exact_pose() -> None:
    np.testing.assert_allclose(check_rigid(make_pose(), "gt.log"), make_pose(), atol=1e-14)


def test_removes_the_rounding_of_a_pose() -> None:
    rigid = check_rigid(make_pose().round(3), "gt.log")
    np.testing.assert_allclose(rigid[:3, :3] @ rigid[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(rigid, make_pose(), atol=1e-3)


def test_refuses_a_pose_that_scales_shears_or_reflects() -> None:
    for change in (np.diag([1.01, 1.01, 1.01, 1]), np.diag([1, 1, -1, 1])):
        with pytest.raises(ValueError, match=r"gt\.log needs a rigid pose"):
            check_rigid(make_pose() @ change, "gt.log")
    sheared = make_pose()
    sheared[0, 1] += 0.1
    with pytest.raises(ValueError, match="needs a rigid pose"):
        check_rigid(sheared, "gt.log")


def test_refuses_a_pose_with_another_last_row_shape_or_nan() -> None:
    transposed = make_pose().T
    with pytest.raises(ValueError, match="needs a rigid pose"):
        check_rigid(transposed, "gt.log")
    with pytest.raises(ValueError, match="needs a finite 4x4 pose"):
        check_rigid(make_pose()[:3], "gt.log")
    with pytest.raises(ValueError, match="needs a finite 4x4 pose"):
        check_rigid(np.full((4, 4), np.nan), "gt.log")
