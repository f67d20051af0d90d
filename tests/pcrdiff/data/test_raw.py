"""Laws and refusals of the nouns that every reader shares."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcrdiff.data.raw import Mesh, check_cloud, check_rigid, sample_points


def make_pose(angle_deg: float = 40.0) -> np.ndarray:
    T_target_source = np.eye(4)
    T_target_source[:3, :3] = Rotation.from_euler("xyz", [angle_deg, 20, 10], True).as_matrix()
    T_target_source[:3, 3] = [1.0, -2.0, 3.0]
    return T_target_source


def test_gives_a_finite_cloud_in_float64() -> None:
    points = check_cloud(np.ones((4, 3), dtype=np.float32), "a.ply")
    assert points.dtype == np.float64
    assert points.shape == (4, 3)


@pytest.mark.parametrize("shape", [(0, 3), (4, 2), (12,), (2, 4, 3)])
def test_refuses_what_is_no_cloud(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"a\.ply needs points as \[n, 3\]"):
        check_cloud(np.zeros(shape), "a.ply")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_refuses_a_coordinate_that_is_not_finite_and_says_where(value: float) -> None:
    points = np.zeros((5, 3))
    points[3, 1] = value
    with pytest.raises(ValueError, match=r"a\.ply .* 1 of its 5 points .* point 3"):
        check_cloud(points, "a.ply")


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


def test_samples_a_mesh_uniformly_by_area() -> None:
    square = np.array([[0.0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0]])
    mesh = Mesh(vertices=square, faces=np.array([[0, 1, 2], [0, 2, 3], [0, 0, 1]]))
    points = sample_points(mesh, 4000, generator=np.random.default_rng(0))
    np.testing.assert_allclose(points.mean(axis=0), [1.5, 0.5, 0.0], atol=0.05)
    assert (points >= 0).all()
    assert (points <= [3, 1, 0]).all()


def test_samples_a_cloud_without_repetition() -> None:
    cloud = np.arange(30.0).reshape(10, 3)
    points = sample_points(cloud, 10, generator=np.random.default_rng(0))
    np.testing.assert_array_equal(np.sort(points, axis=0), cloud)


def test_refuses_too_few_points_and_a_mesh_without_area() -> None:
    generator = np.random.default_rng(0)
    with pytest.raises(ValueError, match="needs 11 points, the cloud has 10"):
        sample_points(np.zeros((10, 3)), 11, generator=generator)
    flat = Mesh(vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]))
    with pytest.raises(ValueError, match="needs a mesh with area"):
        sample_points(flat, 5, generator=generator)
