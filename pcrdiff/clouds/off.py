"""Reading meshes in the Object File Format, with the defects ModelNet40 really has."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from pcrdiff.clouds.number_rows import (
    COUNT,
    QUOTED,
    Line,
    check_width,
    parse_rows,
    read_rows,
    split_lines,
    without_comments,
)
from pcrdiff.clouds.surface import Mesh, check_cloud

INDEX = re.compile(r"[+-]?[0-9]{1,18}")
"""A whole number that 64 bits hold."""


def read_off(path: Path) -> Mesh:
    """Read a mesh in its file's own frame and length unit.

    Comments and blank lines are skipped, polygons are cut into triangles as a fan from their first
    corner, colours are ignored, and a header fused with its counts (``OFF700 664 0``) is read.

    Raises:
        FileNotFoundError: No such file.
        ValueError: No ``OFF`` header, fewer lines than it announces, no face, a vertex that is not
            of finite numbers, or a face that names a vertex which is not there.
    """
    if not path.is_file():
        raise FileNotFoundError(f"read_off needs a mesh file, {path} is missing")
    content = path.read_bytes()
    return _read_plain(content, path) or _read_any(content, path)


def _read_plain(content: bytes, path: Path) -> Mesh | None:
    """Read a mesh without comments, blank lines, polygons or colours, as most are, in two calls.

    None where it has any of these, and where anything is wrong with it: ``_read_any`` says what.
    """
    header, _, body = content.partition(b"\n")
    if header.strip() == b"OFF":
        header, _, body = body.partition(b"\n")
    counts = header.strip().removeprefix(b"OFF").split()
    if len(counts) < 2 or not all(COUNT.fullmatch(count.decode("latin-1")) for count in counts):
        return None
    num_vertices, num_faces = int(counts[0]), int(counts[1])
    line_ends = np.flatnonzero(np.frombuffer(body + b"\n", np.uint8) == ord("\n"))
    if num_vertices == 0 or num_faces == 0 or len(line_ends) < num_vertices + num_faces:
        return None
    middle, end = line_ends[num_vertices - 1] + 1, line_ends[num_vertices + num_faces - 1]
    vertices = parse_rows(body[:middle], num_vertices, 3)
    faces = parse_rows(body[middle:end], num_faces, 4, "whole")
    if vertices is None or faces is None or (faces[:, 0] != 3).any():
        return None
    return _checked(check_cloud(vertices, str(path)), faces[:, 1:], path)


def _read_any(content: bytes, path: Path) -> Mesh:
    lines = split_lines(without_comments(content), path)
    num_vertices, num_faces, start = _read_header(lines, path)
    if len(lines) < start + num_vertices + num_faces:
        raise ValueError(
            f"{path} needs {num_vertices} vertices and {num_faces} faces as its header says, "
            f"it ends after {len(lines) - start} lines"
        )
    vertices = _read_vertices(lines[start : start + num_vertices], path)
    rest = lines[start + num_vertices :][:num_faces]
    faces = np.array([face for line in rest for face in _cut_into_triangles(line, path)])
    return _checked(vertices, faces, path)


def _checked(
    vertices: Float64[np.ndarray, "v 3"], faces: Int64[np.ndarray, "f 3"], path: Path
) -> Mesh:
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(
            f"{path} needs faces of vertices 0..{len(vertices) - 1}, "
            f"got {faces.min()}..{faces.max()}"
        )
    return Mesh(vertices=vertices, faces=faces)


def _read_header(lines: Sequence[Line], path: Path) -> tuple[int, int, int]:
    """Give the counts of vertices and faces, and the line where the vertices start."""
    first = lines[0].text.strip() if lines else ""
    if not first.startswith("OFF"):
        raise ValueError(f"{path} needs to begin with OFF, it begins with {first[:40]!r}")
    fused = first.removeprefix("OFF").split()
    counts = fused or (lines[1].text.split() if len(lines) > 1 else [])
    if len(counts) < 2 or not all(map(COUNT.fullmatch, counts)):
        shown = " ".join(counts)[:QUOTED]
        raise ValueError(f"{path} needs counts of vertices, faces and edges, got {shown!r}")
    if int(counts[0]) == 0 or int(counts[1]) == 0:
        raise ValueError(
            f"{path} needs vertices and faces, its header says {counts[0]} and {counts[1]}"
        )
    return int(counts[0]), int(counts[1]), 1 if fused else 2


def _read_vertices(lines: Sequence[Line], path: Path) -> Float64[np.ndarray, "v 3"]:
    vertices = read_rows(lines, range(3), path, "vertices `x y z`")
    # Colours may follow, at every vertex or at none; a line of another width is a face.
    check_width(lines, len(lines[0].text.split()), path, "vertices `x y z` like the first one")
    return check_cloud(vertices, str(path))


def _cut_into_triangles(line: Line, path: Path) -> list[tuple[int, int, int]]:
    count, *rest = line.text.split()
    words = rest[: int(count)] if INDEX.fullmatch(count) else []
    if not all(map(INDEX.fullmatch, words)) or not 3 <= len(words) == int(count):
        raise ValueError(
            f"{path}, line {line.number}, needs faces `n i j k ...` of whole numbers with n > 2 "
            f"corners, got {line.text.strip()[:QUOTED]!r}"
        )
    corners = [int(word) for word in words]
    return [(corners[0], b, c) for b, c in pairwise(corners[1:])]
