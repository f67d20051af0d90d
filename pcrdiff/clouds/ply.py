"""Reading point clouds in the Polygon File Format.

Not by Open3D: it fills the points a cut file lacks with zeros, and says so on the console only.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from pcrdiff.clouds.number_rows import (
    COUNT,
    QUOTED,
    check_width,
    read_rows,
    split_lines,
    without_comments,
)
from pcrdiff.clouds.surface import Cloud, Oriented, check_cloud, check_extent

NUMBERS = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
}  # fmt: skip
"""numpy's name for each of the format's."""
ON_EARTH = 1e9
"""Coordinates of surveys are smaller, in metres or millimetres; bytes in another order are not."""
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""numpy's byte order for each of the formats."""


@dataclass(frozen=True)
class Header:
    """What a file says about its points."""

    format: str
    count: int
    properties: tuple[tuple[str, str], ...]
    """Name and numpy type of each number of a point, in order."""
    size: int
    """Bytes until the first point."""
    num_lines: int
    """Lines until the first point."""
    alone: bool
    """Whether nothing but points is announced."""

    @property
    def columns(self) -> list[str]:
        """The properties that are read: x, y, z, and the normal where there is one."""
        names, normal = [name for name, _ in self.properties], ["nx", "ny", "nz"]
        return [*"xyz", *(normal if set(normal) <= set(names) else [])]


def read_ply(path: Path) -> Cloud | Oriented:
    """Read the x, y, z of a file's vertices, in its own frame and length unit, and their normals.

    Raises:
        FileNotFoundError: No such file.
        ValueError: No PLY file, vertices that do not come first or lack a coordinate, fewer of
            them than announced, or more where nothing else may follow, none at all, one that is
            not finite, or, in a binary file, one too far away (see ``check_extent``).
    """
    if not path.is_file():
        raise FileNotFoundError(f"read_ply needs a file, {path} is missing")
    header = _read_header(path)
    points = _read_text(path, header) if header.format == "ascii" else _read_binary(path, header)
    if len(points) != header.count:
        raise ValueError(f"{path} needs the {header.count} points it announces, got {len(points)}")
    cloud = check_cloud(points, str(path))
    return cloud if header.format == "ascii" else check_extent(cloud, str(path), farthest=ON_EARTH)


def _read_header(path: Path) -> Header:
    lines = []
    with path.open("rb") as file:
        if file.readline().strip() != b"ply":
            raise ValueError(f"{path} needs to be a PLY file, it does not begin with `ply`")
        for line in file:
            lines.append(line.decode("ascii", errors="replace").split() or [""])
            if lines[-1] == ["end_header"]:
                return _parse_header(lines, file.tell(), path)
    raise ValueError(f"{path} needs the line `end_header`, it has none")


def _parse_header(lines: list[list[str]], size: int, path: Path) -> Header:
    formats = [words[1] for words in lines if words[0] == "format" and len(words) > 1]
    if len(formats) != 1 or formats[0] not in FORMATS:
        raise ValueError(f"{path} needs a format among {', '.join(FORMATS)}, got {formats}")
    starts = [index for index, words in enumerate(lines) if words[0] == "element"]
    vertex = lines[starts[0]] if starts else []
    if vertex[1:2] != ["vertex"] or len(vertex) != 3 or not COUNT.fullmatch(vertex[2]):
        shown = " ".join(vertex)[:QUOTED]
        raise ValueError(f"{path} needs `element vertex N` before other elements, got {shown!r}")
    rows = lines[starts[0] + 1 : starts[1] if len(starts) > 1 else None]
    properties = [words[1:] for words in rows if words[0] == "property"]
    if not all(len(words) == 2 and words[0] in NUMBERS for words in properties):
        raise ValueError(f"{path} needs vertices of plain numbers, got {properties}")
    named = tuple((name, NUMBERS[number]) for number, name in properties)
    if not {"x", "y", "z"} <= dict(named).keys() or len(dict(named)) != len(named):
        raise ValueError(f"{path} needs vertices with one x, y and z, got {properties}")
    return Header(formats[0], int(vertex[2]), named, size, len(lines) + 1, len(starts) == 1)


def _read_binary(path: Path, header: Header) -> Float64[np.ndarray, "points channels"]:
    order = FORMATS[header.format]
    layout = np.dtype([(name, order + number) for name, number in header.properties])
    there = (path.stat().st_size - header.size) // layout.itemsize
    count = min(header.count, there)  # before so much memory is asked for
    if header.alone and there > header.count:
        raise ValueError(
            f"{path} needs the {header.count} points of {layout.itemsize} bytes it announces, its "
            f"size is that of {there}: its numbers may be of another type"
        )
    vertices = np.fromfile(path, dtype=layout, count=count, offset=header.size)
    return np.stack([vertices[name].astype(np.float64) for name in header.columns], axis=1)


def _read_text(path: Path, header: Header) -> Float64[np.ndarray, "points channels"]:
    content = without_comments(path.read_bytes()[header.size :])
    lines = split_lines(content, path, first=header.num_lines + 1)
    if header.alone and len(lines) > header.count:
        raise ValueError(
            f"{path} needs the {header.count} points it announces, got {len(lines)} lines"
        )
    names = [name for name, _ in header.properties]
    columns, form = [names.index(name) for name in header.columns], f"vertices `{' '.join(names)}`"
    points = read_rows(lines[: header.count], columns, path, form)
    check_width(lines[: header.count], len(names), path, form)
    return points
