"""3DMatch's geometric registration benchmark: fused depth fragments of indoor scenes."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from pcrdiff.clouds.number_rows import COUNT, QUOTED, Line, read_lines, read_number
from pcrdiff.clouds.ply import read_ply
from pcrdiff.clouds.surface import Cloud, Oriented, check_extent
from pcrdiff.datasets.items import RawItem, RecordedPair, check_rigid
from pcrdiff.datasets.listing import check_names, list_files, list_folders

EVALUATION = "-evaluation"
BLOCK_LINES = 5
"""A block of ``gt.log``: one line ``i j fragments``, then the four rows of a pose."""


def read_items(root: Path) -> list[RawItem]:
    """List the fragments ``<scene>/cloud_bin_N.ply``, scene by scene, in the order of N.

    Args:
        root: The folder that holds the scenes.

    Returns:
        One item per fragment, in metres; ``group`` is the scene; the benchmark has no split.

    Raises:
        FileNotFoundError: No such folder, or no fragment in it.
        ValueError: A point cloud in a scene has another name.
        OSError: A folder cannot be listed.
    """
    if not root.is_dir():
        raise FileNotFoundError(f"3DMatch needs its folder, {root} is not one")
    scenes = [folder for folder in list_folders(root) if not folder.name.endswith(EVALUATION)]
    paths = [path for scene in scenes for path in _list_fragments(scene)]
    if not paths:
        raise FileNotFoundError(f"3DMatch needs <scene>/cloud_bin_0.ply, {root} holds no fragment")
    fragments = [(path.parent.name, path) for path in paths]
    return [
        RawItem(f"{scene}/{path.stem}", scene, None, partial(read_fragment, path), path)
        for scene, path in fragments
    ]


def read_fragment(path: Path) -> Cloud | Oriented:
    """Read a fragment, in metres.

    Raises:
        FileNotFoundError, ValueError: As ``read_ply``, or a point is a kilometre away.
    """
    return check_extent(read_ply(path), str(path))


def _list_fragments(scene: Path) -> list[Path]:
    paths = list_files(scene, ".ply")
    check_names(paths, r"cloud_bin_(0|[1-9][0-9]*)\.ply", "cloud_bin_0.ply")
    return sorted(paths, key=lambda path: int(path.stem.removeprefix("cloud_bin_")))


def read_recorded_pairs(root: Path) -> list[RecordedPair]:
    """Read the overlapping pairs and their measured poses from each ``<scene>-evaluation/gt.log``.

    A block ``i j`` holds the pose that carries fragment j into the frame of fragment i, so j is
    the source and i the target.

    Args:
        root: The folder that holds the scenes and their evaluation folders.

    Returns:
        Pairs in the order of the logs, poses in metres; ``group`` is the scene.

    Raises:
        FileNotFoundError: No log at all, none in an evaluation folder, or a fragment that a log
            names has no file.
        OSError: A folder cannot be listed.
        ValueError: An evaluation folder has another name, a log is cut or malformed, or a pose is not rigid (see ``check_rigid``).
    """
    folders = [folder for folder in list_folders(root) if EVALUATION in folder.name.casefold()]
    check_names(folders, f".+{EVALUATION}", f"<scene>{EVALUATION}")
    if not folders:
        raise FileNotFoundError(f"3DMatch needs <scene>{EVALUATION}/gt.log, {root} holds none")
    return [pair for folder in folders for pair in read_log(root, folder / "gt.log")]


def read_log(root: Path, path: Path) -> list[RecordedPair]:
    """Read the pairs of one log, whose folder is named after its scene; see ``read_recorded_pairs``.

    Raises:
        FileNotFoundError, ValueError: As there.
    """
    if not path.is_file():
        raise FileNotFoundError(f"3DMatch needs the log {path}, which is missing")
    rows = read_lines(path)
    if len(rows) % BLOCK_LINES != 0 or not rows:
        raise ValueError(
            f"{path} needs blocks of {BLOCK_LINES} lines, the last of its {len(rows)} lines is cut"
        )
    scene = path.parent.name.removesuffix(EVALUATION)
    blocks = [rows[start : start + BLOCK_LINES] for start in range(0, len(rows), BLOCK_LINES)]
    return [_read_block(block, root / scene, path) for block in blocks]


def _read_block(block: Sequence[Line], scene: Path, path: Path) -> RecordedPair:
    head = block[0].text.split()
    where = f"{path}, block {' '.join(head)[:QUOTED]!r},"
    if len(head) != 3 or not all(map(COUNT.fullmatch, head)):
        raise ValueError(f"{where} line {block[0].number}, needs `i j n` of whole numbers")
    target, source, _ = map(int, head)
    matrix: Float64[np.ndarray, "4 4"] = np.array([_read_row(line, where) for line in block[1:]])
    for number in (source, target):
        fragment = scene / f"cloud_bin_{number}.ply"
        if not fragment.is_file():
            raise FileNotFoundError(f"{where} names fragment {number}, but {fragment} is missing")
    names = [f"{scene.name}/cloud_bin_{number}" for number in (source, target)]
    return RecordedPair(names[0], names[1], check_rigid(matrix, where), scene.name)


def _read_row(line: Line, block: str) -> list[float]:
    where, words = f"{block} line {line.number},", line.text.split()
    if len(words) != 4:
        raise ValueError(f"{where} needs 4 numbers, a row of a 4x4 pose, got {len(words)}")
    return [read_number(word, where, "a pose") for word in words]
