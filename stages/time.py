"""DVC stage ``time``: seconds and memory per pair of every method, batch 1, on a quiet machine."""

import argparse
import time
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor

from pcrdiff.geometry.precision import search_precision
from pcrdiff.hypotheses import VerifiedMethod
from pcrdiff.registration import Method, Pairs
from pipeline.compute.machine import end_with_parent, forget_peak, resident, settle
from pipeline.formats.files import write_csv
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import WEIGHTS
from pipeline.loading import load_settings, load_sources, named_count
from pipeline.settings.params import SHOWN, Params, read_params
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, time the registrations, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument(
        "--starts", type=Path, required=True, help="pairs that sources are timed on"
    )
    parser.add_argument("--weights", type=Path, required=True, help="folder of shipped weights")
    parser.add_argument("--costs", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    shown = {"threads": params.threads, "search_precision": search_precision()}
    with journal(params=shown, inputs=[args.pairs]) as notes:
        for name, costs in time_all(params, args.pairs, args.models):
            write_costs(args.costs / f"{name}.csv", costs)
            if name in SHOWN:
                notes.metrics({f"{SHOWN[name]}.seconds": mean_seconds(costs)})
        starts = dict(time_starts(params, args.starts, args.weights))
        write_costs_of_starts(args.costs / f"{STARTS}.csv", params.timing.starts, starts)
        notes.artifact(args.costs)


T = TypeVar("T")
FORK = get_context("fork")
COLUMNS = ("pair", "setting", "seconds", "peak_memory_mib")
STARTS = "starts"
"""What sources of starts took, of which there is one file for all."""


@dataclass(frozen=True)
class Cost:
    """What registering one pair took."""

    seconds: float
    peak_memory_mib: float
    """Resident memory of the process at its highest, above that before its first registration."""


Costs = Mapping[str, list[Cost]]
"""The costs of the first test pairs, by setting."""


def time_all(params: Params, pairs: Path, models: Path) -> Iterator[tuple[str, Costs]]:
    """Time every method of ``params`` that can answer ``timing.scenario``, each in all its settings.

    Each is loaded and timed in a process of its own, so that none profits from memory that another
    has left.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be.
    """
    timing, first = params.timing, first_pairs(params, pairs)
    for name, weights in timed_methods(params, models).items():
        load = partial(load_settings, params, name, pairs, weights)
        yield name, in_a_child(partial(time_settings, load, first, timing.warm_up))


def time_starts(params: Params, pairs: Path, shipped: Path) -> Iterator[tuple[str, Costs]]:
    """Time the sources of ``ablation.starts`` on ``timing.starts``, under each count of starts.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be.
    """
    first = first_pairs(params, pairs)
    for name in params.ablation.starts.sources:
        load = partial(load_counts, params, name, pairs, shipped)
        yield name, in_a_child(partial(time_settings, load, first, params.timing.warm_up))


def load_counts(params: Params, name: str, pairs: Path, shipped: Path) -> Mapping[str, Method]:
    """A source of starts in each of its settings, under each count."""
    sources = load_sources(params, name, params.timing.starts, pairs, shipped)
    return {
        named_count(setting, count): with_starts(source, count)
        for setting, source in sources.items()
        for count in params.ablation.starts.counts
    }


def with_starts(source: VerifiedMethod, count: int) -> VerifiedMethod:
    """The same source with another number of starts."""
    changed = copy(source)
    changed.starts = count
    return changed


def first_pairs(params: Params, pairs: Path) -> Pairs:
    """The test pairs that are timed.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a pair file, or has fewer test pairs.
    """
    test, wanted = read_pairs(pairs, "test"), params.timing.pairs
    if wanted > len(test):
        raise ValueError(f"timing.pairs needs at most the {len(test)} test pairs, got {wanted}")
    return test.select(torch.arange(wanted))


def in_a_child(work: Callable[[], T]) -> T:
    """What ``work`` returns in a forked process.

    Open3D must not be loaded before: its threads do not survive a fork. A new interpreter, as
    ``pcrdiff.bindings.isolation`` has, would load PyTorch again for each method.

    Raises:
        OSError, ValueError: What ``work`` raised.
        RuntimeError: The process ended before it could answer.
    """
    ours, theirs = FORK.Pipe(duplex=False)
    child = FORK.Process(target=_send, args=(work, theirs))
    child.start()
    theirs.close()
    try:
        outcome: T | Exception = ours.recv()
    except EOFError as error:
        child.join()
        raise RuntimeError(
            f"a timed method ended its process, exit code {child.exitcode}"
        ) from error
    child.join()
    if isinstance(outcome, Exception):
        raise outcome
    return outcome


def _send(work: Callable[[], object], answer: Connection) -> None:
    end_with_parent()
    try:
        answer.send(work())
    except (OSError, ValueError, RuntimeError) as error:
        answer.send(error)


def timed_methods(params: Params, models: Path) -> Mapping[str, Path | None]:
    """The methods that can answer ``timing.scenario``, and where a learned one's weights lie.

    Those that are not trained on it have none.
    """
    scenario, run = params.timing.scenario, params.run
    classical: dict[str, Path | None] = dict.fromkeys(run.classical)
    weights = {name: models / name / scenario / WEIGHTS for name in (*run.diffused, *run.baselines)}
    return classical | {name: path for name, path in weights.items() if path.is_file()}


def time_settings(load: Callable[[], Mapping[str, Method]], test: Pairs, warm_up: int) -> Costs:
    """Load a method and time it in each of its settings on the test pairs, one by one."""
    settings, before = load(), resident("VmRSS")
    return {
        name: time_registrations(method, test, warm_up, before) for name, method in settings.items()
    }


def time_registrations(method: Method, test: Pairs, warm_up: int, before: float) -> list[Cost]:
    """Time every pair on its own after ``warm_up`` registrations of the first.

    Memory is counted from ``before``, in MiB: what a method allocates once, in whichever of its
    settings came first, belongs to it. A pair that the method fails on is timed all the same.
    """
    clouds = test.clouds(method.normals)
    costs = []
    for k in [*([0] * warm_up), *range(len(test))]:
        forget_peak()
        start = time.perf_counter()
        _register(method, *(cloud[k : k + 1] for cloud in clouds))
        seconds = time.perf_counter() - start
        costs.append(Cost(seconds, max(0.0, resident("VmHWM") - before)))
    return costs[warm_up:]


def _register(method: Method, source: Tensor, target: Tensor) -> None:
    try:
        method.register(source, target, generator=torch.Generator().manual_seed(0))
    except (ValueError, RuntimeError):
        return  # counted where it is evaluated


def write_costs(path: Path, costs: Costs) -> None:
    """Write ``results/times/<method>.csv``: one row per setting and pair."""
    write_csv(path, [list(COLUMNS), *_rows(costs)])


def write_costs_of_starts(path: Path, scenario: str, costs: Mapping[str, Costs]) -> None:
    """Write the same rows for several methods, led by the scenario and the method's name."""
    rows = [[scenario, name, *row] for name, found in costs.items() for row in _rows(found)]
    write_csv(path, [["scenario", "method", *COLUMNS], *rows])


def _rows(costs: Costs) -> list[list[object]]:
    return [
        [pair, setting, cost.seconds, cost.peak_memory_mib]
        for setting, found in costs.items()
        for pair, cost in enumerate(found)
    ]


def mean_seconds(costs: Costs) -> float:
    """Per pair, in the first setting."""
    first = next(iter(costs.values()))
    return sum(cost.seconds for cost in first) / len(first)
