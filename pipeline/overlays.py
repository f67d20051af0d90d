"""One telling pair of each data set: source, target, and source as each method registered it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from pipeline.background import PairFacts, read_pair_facts, read_test_pair
from pipeline.paper import method_rank, place, scenario_rank, shown
from pipeline.result_files import Scores

OVERLAID = ("pcrdiffusion_cb", "pcrdiffusion_cf", "icp")
"""Methods an overlay shows where there are results; the first chooses the pair."""
Cloud = Float64[np.ndarray, "points 3"]


@dataclass(frozen=True)
class Registered:
    """The source cloud where one method put it, in the target frame."""

    method: str
    points: Cloud
    error_r_deg: float
    error_t: float
    failed: bool


@dataclass(frozen=True)
class Overlay:
    """A test pair, and what methods made of it."""

    facts: PairFacts
    pair: int
    group: str
    source: Cloud
    target: Cloud
    registered: tuple[Registered, ...]
    """The first one chose the pair: its rotation error on it is its median."""

    @property
    def title(self) -> str:
        """The scenario as the reader knows it."""
        return place(self.facts.scenario).title


def read_overlays(scores: Sequence[Scores], pairs: Path) -> list[Overlay]:
    """Make one overlay for each data set, of the first of its scenarios."""
    first: dict[str, str] = {}
    for scenario in sorted({one.scenario for one in scores}, key=scenario_rank):
        first.setdefault(scenario.partition("-")[0], scenario)
    return [_read_overlay(_overlaid(scores, scenario), pairs) for scenario in first.values()]


def median_pair(scores: Scores) -> int:
    """Find the pair whose rotation error is the (lower) median; the first of equals."""
    order = np.argsort(scores.numbers["error_r_deg"], kind="stable")
    return int(scores.pair[order[(len(order) - 1) // 2]])


def move(T_target_source: Float64[np.ndarray, "4 4"], source: Cloud) -> Cloud:
    """Carry points of the source frame into the target frame."""
    return np.asarray(source @ T_target_source[:3, :3].T + T_target_source[:3, 3])


def _overlaid(scores: Iterable[Scores], scenario: str) -> list[Scores]:
    """Pick one setting of each method to show; of the last row, if none of them was run."""
    found: dict[str, Scores] = {}
    ordered = sorted(scores, key=lambda one: (one.setting != "paper", one.setting))
    for one in ordered:
        if one.scenario == scenario and one.ablation is None:
            found.setdefault(one.method, one)
    chosen = [found[method] for method in OVERLAID if method in found]
    return chosen or [found[max(found, key=method_rank)]]


def _read_overlay(scores: Sequence[Scores], pairs: Path) -> Overlay:
    scenario, pair = scores[0].scenario, median_pair(scores[0])
    source, target = read_test_pair(pairs, scenario, pair)
    return Overlay(
        facts=read_pair_facts(pairs, scenario),
        pair=pair,
        group=scores[0].group[scores[0].pair.tolist().index(pair)],
        source=source,
        target=target,
        registered=tuple(_register(one, pair, source) for one in scores),
    )


def _register(scores: Scores, pair: int, source: Cloud) -> Registered:
    row = scores.pair.tolist().index(pair)
    return Registered(
        method=scores.method,
        points=move(scores.T_target_source()[row], source),
        error_r_deg=float(scores.numbers["error_r_deg"][row]),
        error_t=float(scores.numbers["error_t"][row]),
        failed=bool(scores.failed[row]),
    )


def describe(registered: Registered, unit: str) -> str:
    """Say in words how far off one registration is."""
    said = (
        f"{shown(registered.method).name}: rotation off by {registered.error_r_deg:.3g}°,"
        f" translation by {registered.error_t:.3g} ({unit})"
    )
    return said + (" (failed: identity pose shown)" if registered.failed else "")


def thin(points: Cloud, most: int = 2048) -> Cloud:
    """Keep at most so many points, evenly by index."""
    kept = np.linspace(0, len(points) - 1, min(most, len(points))).astype(int)
    return np.asarray(points[kept])
