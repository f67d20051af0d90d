"""Laws and refusals of the nouns that every reader shares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcrdiff.clouds.surface import Mesh, check_cloud, check_extent, sample_oriented, sample_points


def test_gives_a_finite_cloud_in_float64() -> None:
    points = check_cloud(np.ones((4, 3), dtype=np.float32), "a.ply")
    assert points.dtype == np.float64
    assert points.shape == (4, 3)


def test_normals_of_a_cloud_are_kept_as_they_are() -> None:
    points = np.arange(24.0, dtype=np.float32).reshape(4, 6)
    points[2, 4] = np.nan  # a scenario without normals does not mind
    np.testing.assert_array_equal(check_cloud(points, "a.ply"), points.astype(np.float64))


@pytest.mark.parametrize("shape", [(0, 3), (0, 6), (4, 2), (4, 5), (12,), (2, 4, 3)])
def test_refuses_what_is_no_cloud(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"a\.ply needs points as \[n, 3\]"):
        check_cloud(np.zeros(shape), "a.ply")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_refuses_a_coordinate_that_is_not_finite_and_says_where(value: float) -> None:
    points = np.zeros((5, 3))
    points[3, 1] = value
    with pytest.raises(ValueError, match=r"a\.ply .* 1 of its 5 points .* point 3"):
        check_cloud(points, "a.ply")


def test_bytes_of_a_cloud_reach_no_kilometre_but_normals_are_not_looked_at() -> None:
    points = np.full((4, 6), 999.0)
    points[:, 3:] = 1e20
    assert check_extent(points, "a.ply") is points
    points[2, 1] = -1000
    with pytest.raises(ValueError, match=r"a\.ply needs coordinates below 1000, got 1e\+03"):
        check_extent(points, "a.ply")


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


def make_house() -> Mesh:
    """A floor seen from below and two slanted roofs, one of its faces flat."""
    corners = np.array([[0.0, 0, 0], [2, 0, 0], [2, 3, 0], [0, 3, 0], [1, 0, 1], [1, 3, 1]])
    faces = [[0, 3, 1], [1, 3, 2], [0, 4, 3], [3, 4, 5], [1, 2, 4], [2, 5, 4], [0, 0, 1]]
    return Mesh(corners, np.array(faces))


def make_oriented_sphere(count: int = 50) -> np.ndarray:
    normals = np.random.default_rng(1).normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.hstack([5 + 2 * normals, normals])


def test_points_of_a_mesh_have_the_normal_of_their_face() -> None:
    oriented = sample_oriented(make_house(), 200, generator=np.random.default_rng(0))
    slope = 0.5**0.5
    for x, _, z, nx, ny, nz in oriented:
        expected = [0, 0, -1] if z < 1e-12 else [-slope if x < 1 else slope, 0, slope]
        np.testing.assert_allclose([nx, ny, nz], expected, atol=1e-12)


def test_normals_stay_beside_their_points() -> None:
    oriented = sample_oriented(make_oriented_sphere(), 30, generator=np.random.default_rng(0))
    np.testing.assert_allclose(oriented[:, :3], 5 + 2 * oriented[:, 3:], atol=1e-12)


def test_asking_for_normals_changes_no_point() -> None:
    for surface in (make_house(), make_oriented_sphere()):
        points = sample_points(surface, 30, generator=np.random.default_rng(3))
        oriented = sample_oriented(surface, 30, generator=np.random.default_rng(3))
        np.testing.assert_array_equal(oriented[:, :3], points)
        assert points.shape == (30, 3)


def test_normals_have_unit_length_whatever_the_file_rounded_or_filled_in() -> None:
    rounded = make_oriented_sphere().round(3)
    rounded[7, 3:] = 1.0
    oriented = sample_oriented(rounded, 50, generator=np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(oriented[:, 3:], axis=1), 1, atol=1e-12)


def test_refuses_to_give_normals_that_are_none() -> None:
    generator = np.random.default_rng(0)
    with pytest.raises(ValueError, match="needs a cloud with normals, this one has none"):
        sample_oriented(np.zeros((10, 3)), 5, generator=generator)
    for factor in (0.0, np.nan, np.inf):
        cloud = make_oriented_sphere()
        cloud[7, 3:] *= factor
        with pytest.raises(ValueError, match="needs normals with a direction, got one of length"):
            sample_oriented(cloud, 50, generator=generator)
        assert len(sample_points(cloud, 50, generator=generator)) == 50


@given(seed=st.integers(0, 2**32 - 1))
def test_points_fall_on_the_faces_that_numpy_would_choose(seed: int) -> None:
    random = np.random.default_rng(seed)
    vertices = random.normal(size=(12, 3))
    mesh = Mesh(vertices=vertices, faces=random.integers(0, 12, (30, 3)))
    a, b, c = (vertices[mesh.faces[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
    g = np.random.default_rng(seed)
    chosen = g.choice(30, 64, p=areas / areas.sum())
    u, v = g.random((2, 64, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    expected = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    found = sample_points(mesh, 64, generator=np.random.default_rng(seed))
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("length", [1e100, 1e155, 1e300])
def test_refuses_a_mesh_whose_area_is_no_number(length: float) -> None:
    corners = length * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]])
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    with pytest.raises(ValueError, match=r"^sample_points needs a mesh whose area is a number"):
        sample_points(mesh, 5, generator=np.random.default_rng(0))
