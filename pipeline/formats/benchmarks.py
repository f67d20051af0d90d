"""The format of ``benchmarks/**/*.csv``: what `make bench` measured, and what the report shows of it."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from pipeline.formats.files import read_csv, write_csv


@dataclass(frozen=True)
class Ratio:
    """A row of ``speed.csv``: one comparison, both sides measured in the same run."""

    name: str
    ratio: float
    """How many times better than the peer."""
    ours: float
    peer: float
    """Medians, in ``unit``."""
    unit: str
    n: int
    """How many times each side was measured."""
    spread: float
    """Interquartile range of the ratio over these."""
    environment: str


@dataclass(frozen=True)
class Latency:
    """A row of ``details/latency.csv``: one method, in one setting, on the same pairs as the others."""

    method: str
    setting: str
    points: int
    """Points per cloud."""
    latency_ms: float
    """Latency of a pair registered on its own, median over pairs."""
    spread_ms: float
    """Interquartile range over pairs."""
    n: int
    """How many pairs; the first ones, fewer for slow methods."""
    pairs_per_s: float
    """Throughput of ``batch`` pairs given at once, or one after the other to a method that takes one."""
    batch: int
    error_r_deg: float
    error_t: float
    """Means over the pairs, failures scored as the identity."""
    failures: int
    environment: str


@dataclass(frozen=True)
class PeakMemory:
    """A row of ``details/memory.csv``: one registration in a fresh process."""

    method: str
    points: int
    """Points per cloud."""
    peak_mib: float
    """Resident memory of the process at its highest."""
    seconds: float
    environment: str


@dataclass(frozen=True)
class Ceiling:
    """A row of ``details/ceilings.csv``: what the machine can do, or how much of it a loop gets."""

    name: str
    kind: str
    """``machine`` or ``loop``."""
    ms: float
    spread_ms: float
    n: int
    gflop_per_s: float
    gflop_share: float
    """Share of the fastest float32 matrix product measured."""
    gbyte_per_s: float
    """Rate of the bytes that have to move, whatever else was moved."""
    gbyte_share: float
    """Share of the copy measured."""
    environment: str


@dataclass(frozen=True)
class Benchmarks:
    """Everything that one run measured."""

    ratios: Sequence[Ratio] = ()
    latencies: Sequence[Latency] = ()
    memory: Sequence[PeakMemory] = ()
    ceilings: Sequence[Ceiling] = ()


FILES: Mapping[str, tuple[str, type[Any]]] = {
    "latencies": ("details/latency.csv", Latency),
    "memory": ("details/memory.csv", PeakMemory),
    "ceilings": ("details/ceilings.csv", Ceiling),
    "ratios": ("speed.csv", Ratio),
}
"""The file of each part of ``Benchmarks`` and the kind of its rows, in the order of writing."""


def write_benchmarks(folder: Path, found: Benchmarks) -> None:
    """Write the four files, numbers with five digits."""
    for part, (name, kind) in FILES.items():
        header = [field.name for field in fields(kind)]
        rows = [[_text(value) for value in astuple(row)] for row in getattr(found, part)]
        write_csv(folder / name, [header, *rows])


def read_benchmarks(folder: Path) -> Benchmarks | None:
    """Read what was measured last; nothing where nothing was.

    Raises:
        ValueError: A file is cut short, or has other columns.
    """
    if not (folder / FILES["ratios"][0]).is_file():
        return None
    parts = {part: _read(folder / name, kind) for part, (name, kind) in FILES.items()}
    return Benchmarks(**parts)


def _text(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _read(file: Path, kind: type[Any]) -> list[Any]:
    """The rows of a file; none where it is missing."""
    if not file.is_file():
        return []
    header, rows = read_csv(file)
    types: dict[str, Any] = {field.name: field.type for field in fields(kind)}
    if header != [*types]:
        raise ValueError(f"{file} needs the columns {[*types]}, has {header}")
    try:
        return [
            kind(*(make(text) for make, text in zip(types.values(), row, strict=True)))
            for row in rows
        ]
    except ValueError as error:
        raise ValueError(f"{file} holds what is no number: {error}") from error
