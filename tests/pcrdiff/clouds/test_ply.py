"""The Polygon File Format: agreement with Open3D, and the refusals it lacks."""

from pathlib import Path

import numpy as np
import pytest

from pcrdiff.bindings.open3d import open3d
from pcrdiff.clouds.ply import read_ply
from tests.pcrdiff.clouds.no_numbers import NO_NUMBERS

XYZ = "property float x\nproperty float y\nproperty float z\n"


def write(folder: Path, header: str, content: bytes = b"") -> Path:
    path = folder / "cloud_bin_0.ply"
    path.write_bytes(f"ply\n{header}end_header\n".encode() + content)
    return path


@pytest.mark.parametrize("ascii_format", [True, False])
@pytest.mark.parametrize("coloured", [True, False])
def test_reads_what_open3d_writes(tmp_path: Path, ascii_format: bool, coloured: bool) -> None:
    points = np.random.default_rng(0).random((50, 3))
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    if coloured:
        cloud.colors = open3d.utility.Vector3dVector(points)
        cloud.estimate_normals()
    path = tmp_path / "cloud.ply"
    open3d.io.write_point_cloud(path, cloud, write_ascii=ascii_format)
    read = read_ply(path)
    np.testing.assert_allclose(read[:, :3], points, atol=1e-6)  # six digits as text
    normals = np.asarray(cloud.normals) if coloured else np.zeros((50, 0))
    np.testing.assert_allclose(read[:, 3:], normals, atol=1e-6)


def test_reads_big_endian_shuffled_coordinates_and_the_vertices_of_a_mesh(tmp_path: Path) -> None:
    header = (
        "format binary_big_endian 1.0\ncomment by hand\nelement vertex 2\nproperty uchar red\n"
        "property double z\nproperty float x\nproperty float y\n"
        "element face 1\nproperty list uchar int vertex_indices\n"
    )
    layout = np.dtype([("red", "u1"), ("z", ">f8"), ("x", ">f4"), ("y", ">f4")])
    vertices = np.array([(9, 3, 1, 2), (9, 6, 4, 5)], dtype=layout)
    path = write(tmp_path, header, vertices.tobytes() + b"\x01\x00\x00\x00\x00")
    np.testing.assert_array_equal(read_ply(path), [[1, 2, 3], [4, 5, 6]])


def test_refuses_a_cut_file_that_open3d_fills_with_zeros(tmp_path: Path) -> None:
    for kind, content in (
        ("binary_little_endian", np.ones((5, 3), dtype="<f4").tobytes()),
        ("binary_little_endian", np.ones((9, 3), dtype="<f4").tobytes()[:-1]),
        ("ascii", b"1 1 1\n" * 5),
    ):
        path = write(tmp_path, f"format {kind} 1.0\nelement vertex 9\n{XYZ}", content)
        with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs the 9 points it announces"):
            read_ply(path)


@pytest.mark.parametrize(
    ("header", "content", "message"),
    [
        (f"element vertex 1\n{XYZ}", b"", "needs a format among"),
        (f"format ply2 1.0\nelement vertex 1\n{XYZ}", b"", "needs a format among"),
        ("format ascii 1.0\n", b"", "needs `element vertex N`"),
        (f"format ascii 1.0\nelement vertex many\n{XYZ}", b"", "needs `element vertex N`"),
        (
            f"format ascii 1.0\nelement face 1\nelement vertex 1\n{XYZ}",
            b"",
            "before other elements",
        ),
        ("format ascii 1.0\nelement vertex 1\nproperty float x\n", b"1\n", "one x, y and z"),
        (f"format ascii 1.0\nelement vertex 1\n{XYZ}{XYZ}", b"1 1 1 1 1 1\n", "one x, y and z"),
        ("format ascii 1.0\nelement vertex 1\nproperty list int int x\n", b"", "plain numbers"),
        (
            f"format ascii 1.0\nelement vertex 1\n{XYZ}",
            b"1 1 one\n",
            "line 8, needs .* finite numbers",
        ),
        (f"format ascii 1.0\nelement vertex 1\n{XYZ}", b"1 1\n", "line 8, needs vertices `x y z`"),
        (f"format ascii 1.0\nelement vertex 0\n{XYZ}", b"", r"needs points as \[n, 3\]"),
    ],
)
def test_refuses_a_broken_file_and_names_it(
    tmp_path: Path, header: str, content: bytes, message: str
) -> None:
    with pytest.raises(ValueError, match=rf"cloud_bin_0\.ply.* {message}"):
        read_ply(write(tmp_path, header, content))


FACE = "element face 1\nproperty list uchar int vertex_indices\n"


@pytest.mark.parametrize(
    ("header", "content", "message"),
    [
        (f"element vertex 3\n{XYZ}{FACE}", "1 1 1\n2 2 2\n3 0 1 0\n", "got 4 in '3 0 1 0'"),
        (f"element vertex 2\n{XYZ}", "1 1 1 2 2 2\n3 3 3 4 4 4\n", "got 6 in '1 1 1 2 2 2'"),
        (f"element vertex 2\n{XYZ}", "1 1 1\n2 2 2\n3 3 3\n", "needs the 2 points .*, got 3 lines"),
    ],
)
def test_refuses_lines_that_are_no_vertices_or_too_many(
    tmp_path: Path, header: str, content: str, message: str
) -> None:
    path = write(tmp_path, f"format ascii 1.0\n{header}", content.encode())
    with pytest.raises(ValueError, match=rf"cloud_bin_0\.ply.* {message}"):
        read_ply(path)


@pytest.mark.parametrize("announced", ["float", "double"])
def test_refuses_bytes_of_another_type_than_announced(tmp_path: Path, announced: str) -> None:
    size = {"float": "<f8", "double": "<f4"}[announced]
    points = np.random.default_rng(0).integers(1, 9, (50, 3)).astype(size).tobytes()
    xyz = XYZ.replace("float", announced)
    path = write(tmp_path, f"format binary_little_endian 1.0\nelement vertex 50\n{xyz}", points)
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs the 50 points"):
        read_ply(path)


def test_refuses_whole_numbers_in_another_order_than_announced(tmp_path: Path) -> None:
    points = np.array([[1, 2, 3]], ">f4").tobytes()
    path = write(tmp_path, f"format binary_little_endian 1.0\nelement vertex 1\n{XYZ}", points)
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs coordinates that reach 0\.001"):
        read_ply(path)


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_refuses_a_text_with_what_is_no_finite_number(tmp_path: Path, word: str) -> None:
    header = f"format ascii 1.0\ncomment by hand\nelement vertex 2\n{XYZ}"
    path = write(tmp_path, header, f"1 1 1\n\n1 1 {word}\n".encode())
    where = r"cloud_bin_0\.ply, line 11, needs vertices `x y z` of finite numbers"
    with pytest.raises(ValueError, match=where) as refused:
        read_ply(path)
    assert repr(word) in str(refused.value)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_refuses_a_coordinate_that_is_not_finite_in_bytes(tmp_path: Path, value: float) -> None:
    points = np.array([[1, 1, 1], [1, value, 1]], "<f4").tobytes()
    path = write(tmp_path, f"format binary_little_endian 1.0\nelement vertex 2\n{XYZ}", points)
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs finite coordinates"):
        read_ply(path)


def test_refuses_bytes_in_another_order_than_announced(tmp_path: Path) -> None:
    points = np.random.default_rng(0).random((50, 3)).astype(">f4").tobytes()
    path = write(tmp_path, f"format binary_little_endian 1.0\nelement vertex 50\n{XYZ}", points)
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs (finite )?coordinates"):
        read_ply(path)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("count", [10, 4294967295000, 10**17])
def test_asks_for_no_more_memory_than_the_file_has_points(
    tmp_path: Path, kind: str, count: int
) -> None:
    content = b"1 1 1\n" * 9 if kind == "ascii" else np.ones((9, 3), "<f4").tobytes()
    path = write(tmp_path, f"format {kind} 1.0\nelement vertex {count}\n{XYZ}", content)
    with pytest.raises(ValueError, match=rf"cloud_bin_0\.ply needs the {count} .*, got 9"):
        read_ply(path)


@pytest.mark.parametrize("count", [str(10**20), "9" * 5000, "-1", "1_0", "٣", "1 1"])
def test_refuses_a_count_that_is_none(tmp_path: Path, count: str) -> None:
    path = write(tmp_path, f"format ascii 1.0\nelement vertex {count}\n{XYZ}", b"1 1 1\n")
    with pytest.raises(ValueError, match=r"cloud_bin_0\.ply needs `element vertex N`") as refused:
        read_ply(path)
    assert len(str(refused.value)) < 300


def test_refuses_what_is_no_ply_at_all(tmp_path: Path) -> None:
    path = tmp_path / "cloud_bin_0.ply"
    for content in (b"", b"solid stl", b"OFF\n1 1 0\n"):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="does not begin with `ply`"):
            read_ply(path)
    path.write_bytes(b"ply\nformat ascii 1.0\n")
    with pytest.raises(ValueError, match="needs the line `end_header`"):
        read_ply(path)
    with pytest.raises(FileNotFoundError, match="gone"):
        read_ply(tmp_path / "gone.ply")


@pytest.mark.real
def test_agrees_with_open3d_on_real_fragments(real_data: Path) -> None:
    for path in sorted(real_data.glob("3dmatch/*/cloud_bin_0.ply")):
        expected = np.asarray(open3d.io.read_point_cloud(path).points)
        np.testing.assert_array_equal(read_ply(path), expected)
