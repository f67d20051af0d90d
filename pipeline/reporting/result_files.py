"""Read the result files: what each method scored on each pair, checked before it is believed."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int64

from pipeline.formats.answers import POSE
from pipeline.formats.files import read_csv
from pipeline.reporting.paper import ABLATIONS as ABLATED
from pipeline.reporting.paper import TIMING, UNSEEN_OBJECTS, place

EULER = ("rx_deg", "ry_deg", "rz_deg")
SHIFT = ("tx", "ty", "tz")
NUMBERS = ("error_r_deg", "error_t", *EULER, *SHIFT, *POSE)
COLUMNS = ("pair", "item", "group", "setting", "failure", *NUMBERS)
EXTRAS = ("recall", "seconds")
"""Columns a file may have besides: 0 or 1 by the benchmark's own test, and the time taken."""
ABLATIONS, TIMES, WALKS = "ablations", "times", "walks"
"""Folders beside those of the methods."""
NOISE = "noise"
"""The ablation that has a file for each method."""
TIMED = ("seconds", "peak_memory_mib")


@dataclass(frozen=True)
class Scores:
    """How one method did on the test pairs of one scenario under one setting."""

    ablation: str | None
    """The ablation these scores belong to; None for a main table."""
    scenario: str
    method: str
    setting: str
    pair: Int64[np.ndarray, " pairs"]
    """Index in the test group of the pair file, ascending."""
    group: tuple[str, ...]
    """Category or scene of each pair."""
    failed: Bool[np.ndarray, " pairs"]
    numbers: dict[str, Float64[np.ndarray, " pairs"]]
    """The columns ``NUMBERS`` and those of ``EXTRAS`` the file has."""

    @property
    def table(self) -> str:
        """The paper's table that they belong to, or ``extra``."""
        if self.ablation is None:
            return place(self.scenario).table
        return ABLATED[self.ablation].table if self.ablation in ABLATED else "extra"

    def columns(self, names: tuple[str, ...]) -> Float64[np.ndarray, "pairs names"]:
        """Put some of the numbers side by side."""
        return np.stack([self.numbers[name] for name in names], axis=-1)

    def T_target_source(self) -> Float64[np.ndarray, "pairs 4 4"]:
        """Give the estimated poses."""
        poses = np.tile(np.eye(4), (len(self.pair), 1, 1))
        poses[:, :3] = self.columns(POSE).reshape(-1, 3, 4)
        return poses


@dataclass(frozen=True)
class Times:
    """What one method took for each of a few pairs, one at a time, under one setting."""

    method: str
    setting: str
    pair: Int64[np.ndarray, " pairs"]
    """Index in the test group of the pair file, ascending."""
    numbers: dict[str, Float64[np.ndarray, " pairs"]]
    """The columns ``TIMED``: seconds, and MiB of memory above those of the loaded process."""
    table: str = TIMING.table
    scenario: str = UNSEEN_OBJECTS

    @property
    def failed(self) -> Bool[np.ndarray, " pairs"]:
        """Nothing is told of failures: a pair that failed took its time too."""
        return np.zeros(len(self.pair), dtype=bool)


def read_results(folder: Path) -> list[Scores]:
    """Read every ``<method>/<scenario>.csv``, ``ablations/<name>.csv`` and ``ablations/noise/*.csv``.

    Raises:
        FileNotFoundError: There is none.
        ValueError: One is cut short or ill-formed, or its pairs are not those of its neighbours.
    """
    main = [file for file in folder.glob("*/*.csv") if file.parent.name != TIMES]
    files = sorted([*main, *folder.glob(f"{ABLATIONS}/{NOISE}/*.csv")])
    if not files:
        raise FileNotFoundError(f"{folder} needs a <method>/<scenario>.csv, found none")
    read = [(file, one) for file in files for one in read_scores(file)]
    _check_same_pairs(read)
    return [one for _, one in read]


def read_times(folder: Path) -> list[Times]:
    """Read every ``times/<method>.csv`` under ``folder``; none is fine.

    Raises:
        ValueError: One is cut short, has other columns, has a pair twice, or no time above zero.
    """
    return [one for file in sorted(folder.glob(f"{TIMES}/*.csv")) for one in _read_timed(file)]


def _read_timed(file: Path) -> list[Times]:
    header, rows = read_csv(file)
    if header != ["pair", "setting", *TIMED]:
        raise ValueError(
            f"{file} needs the columns pair, setting, {', '.join(TIMED)}, has {header}"
        )
    settings: dict[str, list[list[str]]] = {}
    for row in rows:
        settings.setdefault(row[1], []).append(row)
    return [_times(file, setting, rows) for setting, rows in sorted(settings.items())]


def _times(file: Path, setting: str, rows: list[list[str]]) -> Times:
    pair, order = _pairs(file, setting, [row[0] for row in rows])
    numbers = {
        name: _numbers(file, name, [row[column] for row in rows])[order]
        for column, name in enumerate(TIMED, start=2)
    }
    if not (numbers["seconds"] > 0).all() or (numbers["peak_memory_mib"] < 0).any():
        raise ValueError(f"{file} needs times above zero and memory not below, has others")
    return Times(file.stem, setting, pair, numbers)


def headlines(scores: Iterable[Scores]) -> dict[tuple[str, str], Scores]:
    """Pick the main scores of each scenario and method: the paper's setting, else the first."""
    chosen: dict[tuple[str, str], Scores] = {}
    for one in sorted(scores, key=lambda one: (one.setting != "paper", one.setting)):
        if one.ablation is None:
            chosen.setdefault((one.scenario, one.method), one)
    return chosen


def read_scores(file: Path) -> list[Scores]:
    """Read one result file: one ``Scores`` for each scenario, method and setting in it.

    Raises:
        ValueError: The file is cut short, has other columns, or holds no finite number somewhere.
    """
    header, rows = read_csv(file)
    _check_columns(file, header)
    where = {name: index for index, name in enumerate(header)}
    extras = tuple(name for name in EXTRAS if name in where)
    groups: dict[tuple[str, str, str], list[list[str]]] = {}
    for row in rows:
        scenario, method = file.stem, file.parent.name
        if _ablation_of(file):
            scenario = row[where["scenario"]] if "scenario" in where else UNSEEN_OBJECTS
            method = row[where["method"]]
        groups.setdefault((scenario, method, row[where["setting"]]), []).append(row)
    return [
        _scores(file, key, [dict(zip(header, row, strict=True)) for row in group], extras)
        for key, group in sorted(groups.items())
    ]


def _scores(
    file: Path, key: tuple[str, str, str], rows: list[dict[str, str]], extras: tuple[str, ...]
) -> Scores:
    scenario, method, setting = key
    pair, order = _pairs(file, setting, [row["pair"] for row in rows])
    rows = [rows[index] for index in order]
    return Scores(
        ablation=_ablation_of(file),
        scenario=scenario,
        method=method,
        setting=setting,
        pair=pair,
        group=tuple(row["group"] for row in rows),
        failed=np.array([row["failure"] != "" for row in rows]),
        numbers={
            name: _numbers(file, name, [row[name] for row in rows]) for name in (*NUMBERS, *extras)
        },
    )


def _pairs(
    file: Path, setting: str, texts: list[str]
) -> tuple[Int64[np.ndarray, " pairs"], Int64[np.ndarray, " pairs"]]:
    """Read the pairs' indices, ascending, and say which row each is in."""
    pair = _numbers(file, "pair", texts).astype(np.int64)
    order = np.argsort(pair, kind="stable")
    twice = pair[order][1:][np.diff(pair[order]) == 0]
    if len(twice):
        raise ValueError(f"{file} needs one row a pair, has pair {twice[0]} twice in {setting}")
    return pair[order], order


def _numbers(file: Path, column: str, texts: list[str]) -> Float64[np.ndarray, " pairs"]:
    wrong = next((text for text in texts if not _is_finite(text)), None)
    if wrong is not None:
        raise ValueError(f"{file} needs a finite number in column {column}, got {wrong!r}")
    return np.array([*map(float, texts)])


def _is_finite(text: str) -> bool:
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def _ablation_of(file: Path) -> str | None:
    if file.parent.name == NOISE:
        return NOISE
    return file.stem if file.parent.name == ABLATIONS else None


def _check_columns(file: Path, header: list[str]) -> None:
    needed = {*COLUMNS, *(["method"] if _ablation_of(file) else [])}
    known = {*needed, *EXTRAS, *(["scenario"] if _ablation_of(file) else [])}
    missing, unknown = sorted(needed - {*header}), sorted({*header} - known)
    if missing:
        raise ValueError(f"{file} needs the columns {', '.join(missing)}, it lacks them")
    if unknown:
        raise ValueError(f"{file} has columns nobody here reads: {', '.join(unknown)}")


def _check_same_pairs(read: list[tuple[Path, Scores]]) -> None:
    union: dict[tuple[str | None, str], set[int]] = {}
    for _, one in read:
        union.setdefault((one.ablation, one.scenario), set()).update(one.pair.tolist())
    for file, one in read:
        wanted = len(union[one.ablation, one.scenario])
        if len(one.pair) != wanted:
            raise ValueError(
                f"{file} needs all {wanted} pairs its scenario was tried on,"
                f" has {len(one.pair)} under {one.method}, {one.setting}"
            )
