"""Points of a file in any format: what comes back, and the sentence where nothing can."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pcrdiff.any_files import MESH_POINTS, READERS, read_any
from pcrdiff.bindings.open3d import open3d

POINTS = np.array([4e5, 5e6, 100]) + np.random.default_rng(0).normal(size=(50, 3))  # as in surveys
CUBE = open3d.geometry.TriangleMesh.create_box()


def write_cloud(path: Path) -> None:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(POINTS))
    open3d.io.write_point_cloud(path, cloud)


def write_mesh(path: Path) -> None:
    CUBE.compute_triangle_normals()
    open3d.io.write_triangle_mesh(path, CUBE)


def write_bin(path: Path) -> None:
    np.hstack([POINTS, np.zeros((50, 1))]).astype("<f4").tofile(path)


CLOUDS: dict[str, Callable[[Path], None]] = {
    ".ply": write_cloud,
    ".pcd": write_cloud,
    ".npy": lambda path: np.save(path, np.hstack([POINTS, POINTS])),
    ".npz": lambda path: np.savez(path, cloud=POINTS),
    ".xyz": lambda path: np.savetxt(path, POINTS),
    ".txt": lambda path: np.savetxt(path, POINTS, delimiter=" ; ", header="x y z"),
    ".csv": lambda path: np.savetxt(
        path, POINTS[:, ::-1], delimiter=",", header="z,y,x", comments=""
    ),
    ".bin": write_bin,
}
MESHES = (".off", ".obj", ".stl")


@pytest.mark.parametrize("ending", CLOUDS)
def test_a_cloud_comes_back_point_by_point(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"cloud{ending.upper()}"
    CLOUDS[ending](path.with_suffix(ending))
    path.with_suffix(ending).rename(path)
    exact = ending in (".npy", ".npz", ".xyz", ".txt", ".csv", ".ply")
    np.testing.assert_allclose(read_any(path), POINTS, rtol=1e-12 if exact else 1e-7)


@pytest.mark.parametrize("ending", MESHES)
def test_of_a_mesh_points_are_drawn_from_its_surface_the_same_ones_each_time(
    tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"cube{ending}"
    write_mesh(path)
    points = read_any(path)
    assert points.shape == (MESH_POINTS, 3)
    assert np.minimum(np.abs(points), np.abs(points - 1)).min(axis=1).max() < 1e-6
    np.testing.assert_array_equal(points, read_any(path))


def test_every_reader_is_tested() -> None:
    assert READERS.keys() == {*CLOUDS, *MESHES}


def test_points_of_an_organised_cloud_that_saw_nothing_are_left_out(tmp_path: Path) -> None:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector([[1, 2, 3], [np.nan] * 3]))
    path = tmp_path / "cloud.pcd"
    open3d.io.write_point_cloud(path, cloud)
    np.testing.assert_array_equal(read_any(path), [[1, 2, 3]])


BROKEN: dict[str, tuple[bytes, str]] = {
    "no_ending": (b"1 2 3", "needs an ending among"),
    "cut.bin": (b"123", "needs 16 bytes a point"),
    "empty.xyz": (b"", r"needs points as \[n, 3\]"),
    "letters.xyz": (b"1 2 3\n1 2 b\n", "line 2, needs rows x, y, z"),
    "array.npy": (b"no array", "needs to be an array that NumPy saved"),
    "nan.csv": (b"x,y,z\n1,2,nan\n", "finite numbers"),
    "cloud.pcd": (b"# .PCD v0.7\nFIELDS x\n", "PCD file"),
    "sizes.pcd": (b"# .PCD v0.7\nPOINTS 1\nDATA ascii\n1 2 3\n", "the line `SIZE`"),
    "archive.npz": (b"PK no archive", "NumPy saved"),
    "mesh.obj": (b"not a mesh", r"needs points as \[n, 3\]"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_cannot_be_read_is_refused_by_name(tmp_path: Path, name: str) -> None:
    path, (content, message) = tmp_path / name, BROKEN[name]
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as refused:
        read_any(path)
    assert str(path) in str(refused.value)


def test_a_cut_pcd_is_refused_where_open3d_fills_it_with_zeros(tmp_path: Path) -> None:
    path = tmp_path / "cloud.pcd"
    write_cloud(path)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(ValueError, match="needs the 50 points"):
        read_any(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.ply, there is no such file"):
        read_any(tmp_path / "none.ply")


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    path = tmp_path / "objects.npy"
    np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(ValueError, match="NumPy saved"):
        read_any(path)
