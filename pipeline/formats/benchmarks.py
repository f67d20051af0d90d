"""The format of ``benchmarks/**/*.csv``: what `make bench` measured, and what the report shows of it."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

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


Row = TypeVar("Row", Ratio, Latency, PeakMemory, Ceiling)
SPEED = "speed.csv"
LATENCY, MEMORY, CEILINGS = (f"details/{name}.csv" for name in ("latency", "memory", "ceilings"))


def write_benchmarks(folder: Path, found: Benchmarks) -> None:
    """Write the four files, numbers with five digits."""
    _write(folder / LATENCY, Latency, found.latencies)
    _write(folder / MEMORY, PeakMemory, found.memory)
    _write(folder / CEILINGS, Ceiling, found.ceilings)
    _write(folder / SPEED, Ratio, found.ratios)


def read_benchmarks(folder: Path) -> Benchmarks | None:
    """Read what was measured last; nothing where nothing was.

    Raises:
        ValueError: A file is cut short, or has other columns.
    """
    if not (folder / SPEED).is_file():
        return None
    return Benchmarks(
        ratios=_read(folder / SPEED, Ratio),
        latencies=_read(folder / LATENCY, Latency),
        memory=_read(folder / MEMORY, PeakMemory),
        ceilings=_read(folder / CEILINGS, Ceiling),
    )


def columns(kind: type[Any]) -> list[str]:
    """The header of a file with rows of this kind."""
    return [field.name for field in fields(kind)]


def _write(file: Path, kind: type[Any], rows: Sequence[Any]) -> None:
    write_csv(file, [columns(kind), *([_text(value) for value in astuple(row)] for row in rows)])


def _text(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _read(file: Path, kind: type[Row]) -> list[Row]:
    """The rows of a file; none where it is missing."""
    if not file.is_file():
        return []
    header, rows = read_csv(file)
    if header != columns(kind):
        raise ValueError(f"{file} needs the columns {columns(kind)}, has {header}")
    types = [field.type for field in fields(kind)]
    try:
        return [
            kind(*(make(text) for make, text in zip(types, row, strict=True)))  # type: ignore[operator]
            for row in rows
        ]
    except ValueError as error:
        raise ValueError(f"{file} holds what is no number: {error}") from error
