"""How long a method takes for a pair, and how much memory: Table 6. Nothing else may run beside."""

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from pcrdiff.registration import Method, Pairs
from pipeline.artifacts import read_pairs, write_csv
from pipeline.evaluating import load_settings
from pipeline.params import Params

COLUMNS = ("pair", "setting", "seconds", "peak_memory_mib")


@dataclass(frozen=True)
class Cost:
    """What registering one pair took."""

    seconds: float
    peak_memory_mib: float
    """Resident memory of the process at its highest, above that before its first registration."""


def time_method(
    params: Params, name: str, pairs: Path, weights: Path | None
) -> Mapping[str, list[Cost]]:
    """Time a method in each of its settings on the first test pairs, one by one.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be.
    """
    settings = load_settings(params, name, pairs, weights)
    test, wanted = read_pairs(pairs, "test"), params.timing.pairs
    if wanted > len(test):
        raise ValueError(f"timing.pairs needs at most the {len(test)} test pairs, got {wanted}")
    first, before = test.select(torch.arange(wanted)), resident("VmRSS")
    return {
        setting: time_pairs(method, first, params.timing.warm_up, before)
        for setting, method in settings.items()
    }


def time_pairs(method: Method, test: Pairs, warm_up: int, before: float) -> list[Cost]:
    """Time every pair by itself after ``warm_up`` registrations of the first.

    Memory is counted from ``before``, in MiB: what a method allocates once, in whichever of its
    settings came first, belongs to it. A pair that the method fails on is timed all the same.
    """
    clouds = test.clouds(getattr(method, "normals", "estimated"))
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


def resident(which: str) -> float:
    """Resident memory of this process in MiB, now (``VmRSS``) or at its highest (``VmHWM``).

    Raises:
        FileNotFoundError: The system has no ``/proc``.
    """
    status = Path("/proc/self/status").read_text(encoding="utf-8", errors="replace")
    found = re.search(rf"^{which}:\s+(\d+) kB$", status, re.MULTILINE)
    if found is None:
        raise ValueError(f"/proc/self/status needs a line {which}, it has none")
    return int(found[1]) / 1024


def forget_peak() -> None:
    """Let the highest resident memory be counted from now on."""
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def write_costs(path: Path, costs: Mapping[str, list[Cost]]) -> None:
    """Write ``results/times/<method>.csv``: a row a setting and pair."""
    rows = [
        [pair, setting, cost.seconds, cost.peak_memory_mib]
        for setting, found in costs.items()
        for pair, cost in enumerate(found)
    ]
    write_csv(path, [list(COLUMNS), *rows])


def summarise(costs: Mapping[str, list[Cost]]) -> dict[str, float]:
    """Mean seconds and memory by setting."""
    summary: dict[str, float] = {}
    for setting, found in costs.items():
        summary[f"{setting}.seconds"] = sum(c.seconds for c in found) / len(found)
        summary[f"{setting}.peak_memory_mib"] = sum(c.peak_memory_mib for c in found) / len(found)
    return summary
