"""Timing calls side by side, and what a comparison comes to."""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from pcrdiff.geometry.precision import search_precision
from pipeline.formats.benchmarks import Ratio
from pipeline.tracking.journal import processor


@dataclass(frozen=True)
class Comparison:
    """The same work done twice, by this project and by a peer; value k of both belongs together."""

    name: str
    ours: Sequence[float]
    peer: Sequence[float]
    unit: str
    higher_is_better: bool


@dataclass(frozen=True)
class Summary:
    """What repeated measurements come to."""

    median: float
    spread: float
    """Interquartile range."""
    n: int


def summarise(values: Sequence[float]) -> Summary:
    """Median and interquartile range.

    Raises:
        ValueError: There is no value.
    """
    if not values:
        raise ValueError("summarise needs at least one value, got none")
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
    return Summary(middle, high - low, len(values))


def compare(comparison: Comparison, environment: str) -> Ratio:
    """How many times better ours is: the ratio of the medians, larger is better.

    Its spread is that of the ratios of values that belong together.

    Raises:
        ValueError: There are more values of one than of the other, or none.
    """
    ours, peer = comparison.ours, comparison.peer
    if len(ours) != len(peer):
        raise ValueError(f"{comparison.name} needs as many of ours as of the peer's, got {len(ours)} and {len(peer)}")  # fmt: skip
    better, worse = (ours, peer) if comparison.higher_is_better else (peer, ours)
    each = summarise([b / w for b, w in zip(better, worse, strict=True)])
    return Ratio(
        name=comparison.name,
        ratio=summarise(better).median / summarise(worse).median,
        ours=summarise(ours).median,
        peer=summarise(peer).median,
        unit=comparison.unit,
        n=each.n,
        spread=each.spread,
        environment=environment,
    )


def alternate(
    calls: Sequence[Callable[[], object]], repeats: int, warm_up: int
) -> list[list[float]]:
    """Seconds of each call, one after the other ``repeats`` times, so that all see one machine."""
    seconds: list[list[float]] = [[] for _ in calls]
    for repeat in range(warm_up + repeats):
        for call, found in zip(calls, seconds, strict=True):
            took = time_of(call)
            if repeat >= warm_up:
                found.append(took)
    return seconds


def time_of(call: Callable[[], object]) -> float:
    """Seconds of one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def describe_environment() -> str:
    """Processor, cores, threads, torch and the precision of the search; no name of a host."""
    cores, threads = os.cpu_count() or 1, torch.get_num_threads()
    held = f"{_counted(cores, 'core')}; {_counted(threads, 'thread')}"
    version = torch.__version__.partition("+")[0]
    return f"{processor()}; {held}; torch {version}; {search_precision()} search"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"
