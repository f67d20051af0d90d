"""The format of a walk back from noise: the pose at each step, for the page's slider."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from pipeline.formats.answers import POSE
from pipeline.formats.files import read_csv, write_csv

COLUMNS = ("pair", "step", "time", "kind", *POSE)


@dataclass(frozen=True)
class RecordedWalk:
    """One pair's walk back under one method."""

    method: str
    pair: int
    """Index in the test group of the pair file."""
    times: tuple[int, ...]
    """The time t of each step, from T down."""
    noisy: Float64[np.ndarray, "steps 4 4"]
    """G_t read as T_target_source, before each step."""
    predicted: Float64[np.ndarray, "steps 4 4"]
    """The prediction of G_0 made at each step; the last one is the answer."""


def write_walks(path: Path, walks: list[RecordedWalk]) -> None:
    """Write ``results/walks/<scenario>/<method>.csv``: two rows per step."""
    rows: list[list[object]] = [
        [walk.pair, step, time, kind, *pose[:3].ravel().tolist()]
        for walk in walks
        for step, time in enumerate(walk.times)
        for kind, pose in (("noisy", walk.noisy[step]), ("predicted", walk.predicted[step]))
    ]
    write_csv(path, [list(COLUMNS), *rows])


def read_walks(path: Path) -> list[RecordedWalk]:
    """Read what :func:`write_walks` wrote; the method is the file's stem.

    Raises:
        ValueError: The file is cut short or has other columns.
    """
    header, rows = read_csv(path)
    if tuple(header) != COLUMNS:
        raise ValueError(f"{path} needs the columns {', '.join(COLUMNS)}, has {', '.join(header)}")
    pairs = dict.fromkeys(int(row[0]) for row in rows)
    return [_walk(path.stem, pair, [row for row in rows if int(row[0]) == pair]) for pair in pairs]


def _walk(method: str, pair: int, rows: list[list[str]]) -> RecordedWalk:
    poses: dict[str, list[Float64[np.ndarray, "4 4"]]] = {"noisy": [], "predicted": []}
    for row in rows:
        pose = np.eye(4)
        pose[:3] = np.array([float(text) for text in row[4:]]).reshape(3, 4)
        poses[row[3]].append(pose)
    times = tuple(int(row[2]) for row in rows if row[3] == "noisy")
    return RecordedWalk(method, pair, times, np.stack(poses["noisy"]), np.stack(poses["predicted"]))
