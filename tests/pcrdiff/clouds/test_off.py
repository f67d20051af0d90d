"""The Object File Format, its variants and its defects."""

from pathlib import Path

import numpy as np
import pytest

from pcrdiff.clouds.off import read_off
from tests.pcrdiff.clouds.no_numbers import NO_NUMBERS

SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "shape_0001.off"
    path.write_text(text)
    return path


@pytest.mark.parametrize("header", ["OFF\n4 2 0\n", "OFF4 2 0\n", "OFF 4 2 0\n", "OFF\n4 2\n"])
def test_reads_every_header_modelnet_has(tmp_path: Path, header: str) -> None:
    mesh = read_off(write(tmp_path, header + SQUARE + "3 0 1 2\n3 0 2 3\n"))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_reads_comments_blank_lines_windows_line_ends_and_colours(tmp_path: Path) -> None:
    text = (
        f"# made by hand\nOFF # header\n\n4 2 0\n{SQUARE}\n3 0 1 2 0.5 0.5 0.5\n3  0 2 3 255 0 0\n"
    )
    path = tmp_path / "shape_0001.off"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    mesh = read_off(path)
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert len(mesh.vertices) == 4


def test_reads_vertices_with_colours(tmp_path: Path) -> None:
    coloured = SQUARE.replace("\n", " 0 0 9 1\n")
    mesh = read_off(write(tmp_path, f"OFF\n4 1 0\n{coloured}3 0 1 2\n"))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_cuts_a_polygon_into_a_fan(tmp_path: Path) -> None:
    mesh = read_off(write(tmp_path, f"OFF\n4 2 0\n{SQUARE}4 0 1 2 3\n3 1 2 3\n"))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [1, 2, 3]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "needs to begin with OFF"),
        (SQUARE, "needs to begin with OFF"),
        ("OFF\n", "needs counts"),
        ("OFF\nfour 2 0\n", "needs counts"),
        (f"OFF\n4 {10**20} 0\n{SQUARE}3 0 1 2\n", "needs counts"),
        (f"OFF\n{'9' * 5000} 1 0\n{SQUARE}3 0 1 2\n", "needs counts"),
        (f"OFF\n{10**17} 1 0\n{SQUARE}3 0 1 2\n", f"needs {10**17} vertices .* after 5 lines"),
        (f"OFF\n4 {10**17} 0 # a\n{SQUARE}3 0 1 2\n", "needs 4 vertices .* after 5 lines"),
        (f"OFF\n4 0 0\n{SQUARE}", "needs vertices and faces"),
        ("OFF\n0 0 0\n", "needs vertices and faces"),
        (f"OFF\n4 3 0\n{SQUARE}3 0 1 2\n", "needs 4 vertices and 3 faces .* ends after 5 lines"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 4\n", r"needs faces of vertices 0\.\.3, got 0\.\.4"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 -1\n", r"needs faces of vertices 0\.\.3"),
        (f"OFF\n4 1 0\n{SQUARE}2 0 1\n", "line 7, needs faces `n i j k"),
        (f"OFF\n4 1 0\n{SQUARE}4 0 1 2\n", "line 7, needs faces `n i j k"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 x\n", "line 7, needs faces `n i j k"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 1.5\n", "line 7, needs faces .* whole numbers"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 {10**20}\n", "line 7, needs faces .* whole numbers"),
        (f"OFF\n4 1 0\n{SQUARE}3 0 1 2#\n", "line 7, needs faces .* whole numbers"),
        (f"OFF\n4 1 0\n{SQUARE.replace('1 1 0', '1 1')}3 0 1 2\n", "line 5, needs vertices"),
        (
            f"OFF\n5 1 0\n{SQUARE}3 0 1 2\n3 0 2 3\n",
            "line 7, needs vertices .*, got 4 in '3 0 1 2'",
        ),
        (f"OFF\n4 1 0\n{SQUARE.replace('1 1 0', '1 1 0 9')}3 0 1 2\n", "line 5, needs vertices"),
        (f"OFF\n4 1 0\n{SQUARE}3 0x0 1 2\n", "line 7, needs faces .* whole numbers"),
        (f"OFF\n4 1 0\n{SQUARE}0X3 0x0 0x1 0x2\n", "line 7, needs faces .* whole numbers"),
    ],
)
def test_refuses_a_broken_mesh_and_names_the_file(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"shape_0001\.off,? {message}"):
        read_off(write(tmp_path, text))


@pytest.mark.parametrize("word", NO_NUMBERS)
@pytest.mark.parametrize("comment", ["", "# by hand\n"])
def test_refuses_a_vertex_of_what_is_no_finite_number(
    tmp_path: Path, word: str, comment: str
) -> None:
    text = f"OFF\n4 1 0\n{comment}{SQUARE.replace('1 1 0', f'1 1 {word}')}3 0 1 2\n"
    where = rf"shape_0001\.off, line {6 if comment else 5}, needs vertices .* finite numbers"
    with pytest.raises(ValueError, match=where) as refused:
        read_off(write(tmp_path, text))
    assert repr(word) in str(refused.value)


def test_a_comment_begins_a_line_or_stands_after_a_blank(tmp_path: Path) -> None:
    text = "#a\nOFF\t#b\n4 1 0 #c\n  # d # e\n0 0 0 # 7\n1 0 0\t#\n1 1 0 #1#\n0 1 0\n3 0 1 2 # f\n"
    mesh = read_off(write(tmp_path, text))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_names_the_line_that_is_not_in_utf8_but_reads_past_such_a_comment(tmp_path: Path) -> None:
    path = tmp_path / "shape_0001.off"
    text = f"OFF # caf\xe9\n4 1 0\n{SQUARE}3 0 1 2\n"
    path.write_bytes(text.encode("latin-1"))
    assert len(read_off(path).vertices) == 4
    path.write_bytes(text.replace("1 1 0", "1 1 \xe9").encode("latin-1"))
    with pytest.raises(ValueError, match=r"shape_0001\.off, line 5, .*UTF-8.*0xe9.*Latin-1"):
        read_off(path)
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(ValueError, match=r"shape_0001\.off .*UTF-8, it begins as UTF-16 does"):
        read_off(path)


def test_refuses_a_mesh_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nothing\.off is missing"):
        read_off(tmp_path / "nothing.off")


@pytest.mark.real
def test_reads_the_fused_header_and_refuses_the_missing_one(real_data: Path) -> None:
    mesh = read_off(real_data / "malformed/off_fused_header.off")
    assert mesh.vertices.shape == (700, 3)
    assert mesh.faces.shape == (664, 3)
    assert np.isfinite(mesh.vertices).all()
    with pytest.raises(ValueError, match=r"off_without_header\.off needs to begin with OFF"):
        read_off(real_data / "malformed/off_without_header.off")
