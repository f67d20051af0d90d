"""Telling pairs of each data set: source, target, and source as each method registered it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float64

from pipeline.formats.walks import Walk
from pipeline.reporting.background import PairFacts, PairFile
from pipeline.reporting.paper import method_rank, place, scenario_rank, shown
from pipeline.reporting.result_files import Scores, headlines

CHOOSERS = ("pcrdiffusion_cb", "pcrdiffusion_cf", "icp")
"""The first of these there are results of chooses the pairs by its rotation error."""
Choice = Literal["best", "median", "worst"]
Cloud = Float64[np.ndarray, "points 3"]


@dataclass(frozen=True)
class Registered:
    """The source cloud where one method put it, in the target frame."""

    method: str
    T_target_source: Float64[np.ndarray, "4 4"]
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
    """The first one chose the pair; the others follow in the order of the tables."""
    others: tuple["Overlay", ...] = ()
    """Of a data set's median pair, the best and the worst beside it."""

    @property
    def title(self) -> str:
        """The scenario as the reader knows it."""
        return place(self.facts.scenario).title

    @property
    def choices(self) -> dict[Choice, "Overlay"]:
        """The best, the median and the worst pair; of those there are."""
        if not self.others:
            return {"median": self}
        return {"best": self.others[0], "median": self, "worst": self.others[1]}


@dataclass(frozen=True)
class KnownPair:
    """The clouds of a test pair, each in its own frame, and the true pose."""

    group: str
    source: Cloud
    target: Cloud
    T_target_source: Float64[np.ndarray, "4 4"]


def make_overlays(scores: Sequence[Scores], files: Mapping[str, PairFile]) -> list[Overlay]:
    """Make the median overlay of each data set, of the first of its scenarios."""
    first: dict[str, str] = {}
    for scenario in sorted({one.scenario for one in scores}, key=scenario_rank):
        first.setdefault(scenario.partition("-")[0], scenario)
    return [
        _three_overlays(_overlaid(scores, scenario), files[scenario]) for scenario in first.values()
    ]


def pick_walked_pairs(
    walks: Mapping[str, Sequence[Walk]], files: Mapping[str, PairFile]
) -> dict[str, dict[int, KnownPair]]:
    """Pick the test pairs that were walked, by scenario and index in its test group.

    Raises:
        ValueError: A scenario lacks a pair that was walked.
    """
    return {
        scenario: {
            pair: _known_pair(files[scenario], pair) for pair in sorted({w.pair for w in walked})
        }
        for scenario, walked in sorted(walks.items())
    }


def choose_pairs(scores: Scores) -> dict[Choice, int]:
    """Find the pairs of smallest, (lower) median and largest rotation error; first of equals."""
    order = np.argsort(scores.numbers["error_r_deg"], kind="stable")
    return {
        "best": int(scores.pair[order[0]]),
        "median": int(scores.pair[order[(len(order) - 1) // 2]]),
        "worst": int(scores.pair[order[-1]]),
    }


def move(T_target_source: Float64[np.ndarray, "4 4"], source: Cloud) -> Cloud:
    """Carry points of the source frame into the target frame."""
    return np.asarray(source @ T_target_source[:3, :3].T + T_target_source[:3, 3])


def headline_scores(scores: Iterable[Scores], scenario: str) -> dict[str, Scores]:
    """Pick one setting of each method, the paper's where it was run, in the order of the rows."""
    found = {method: one for (where, method), one in headlines(scores).items() if where == scenario}
    return {method: found[method] for method in sorted(found, key=method_rank)}


def _overlaid(scores: Iterable[Scores], scenario: str) -> list[Scores]:
    """List all methods, the one that chooses the pairs first; the last row, if there is none."""
    found = headline_scores(scores, scenario)
    chooser = next((method for method in CHOOSERS if method in found), [*found][-1])
    return [found.pop(chooser), *found.values()]


def _three_overlays(scores: Sequence[Scores], file: PairFile) -> Overlay:
    chosen = {
        choice: _overlay(scores, file, pair) for choice, pair in choose_pairs(scores[0]).items()
    }
    return replace(chosen["median"], others=(chosen["best"], chosen["worst"]))


def _overlay(scores: Sequence[Scores], file: PairFile, pair: int) -> Overlay:
    known = _known_pair(file, pair)
    return Overlay(
        facts=file.facts,
        pair=pair,
        group=scores[0].group[scores[0].pair.tolist().index(pair)],
        source=known.source,
        target=known.target,
        registered=tuple(_register(one, pair, known.source) for one in scores),
    )


def _known_pair(file: PairFile, pair: int) -> KnownPair:
    test = file.test
    if not 0 <= pair < len(test):
        raise ValueError(f"{file.facts.scenario} needs a test pair {pair}, it has {len(test)}")
    return KnownPair(
        group=test.group[pair],
        source=test.source[pair].double().numpy(),
        target=test.target[pair].double().numpy(),
        T_target_source=test.T_target_source[pair].double().numpy(),
    )


def _register(scores: Scores, pair: int, source: Cloud) -> Registered:
    row = scores.pair.tolist().index(pair)
    pose = scores.T_target_source()[row]
    return Registered(
        method=scores.method,
        T_target_source=pose,
        points=move(pose, source),
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
