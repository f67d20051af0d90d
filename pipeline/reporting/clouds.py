"""Pairs to look at: source, target, where each method put the source, and walks back from noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float64

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pipeline.formats.answers import POSE
from pipeline.formats.walks import RecordedWalk
from pipeline.reporting.drawing import ranks, thinned
from pipeline.reporting.paper import place, scenario_rank, shown
from pipeline.reporting.reading import PairFile, choose

CHOOSERS = ("pcrdiffusion_cb", "pcrdiffusion_cf", "icp")
"""The first of these there are results of chooses the pairs by its rotation error."""
Cloud = Float64[np.ndarray, "points 3"]
Pose = Float64[np.ndarray, "4 4"]


@dataclass(frozen=True)
class Example:
    """A test pair, and where each method put its source cloud."""

    scenario: str
    choice: str
    """``best``, ``median`` or ``worst``, by the rotation error of the first method."""
    pair: int
    group: str
    unit: str
    source: Cloud
    target: Cloud
    answers: pd.DataFrame
    """A row per method: the one that chose the pair, then the others in the order of the tables."""

    @property
    def dataset(self) -> str:
        """The data set of the scenario."""
        return self.scenario.partition("-")[0]

    @property
    def title(self) -> str:
        """The scenario as the reader knows it."""
        return place(self.scenario).title

    def registered(self, answer: Mapping[str, Any]) -> Cloud:
        """Give the source cloud as an answer puts it, in the target frame."""
        return move(pose_of(answer), self.source)


def choose_examples(answers: pd.DataFrame, files: Mapping[str, PairFile]) -> list[Example]:
    """Choose the best, the median and the worst pair of the first scenario of each data set.

    Raises:
        ValueError: An answer is to a pair that the pair file does not have.
    """
    first: dict[str, str] = {}
    for scenario in sorted({*answers["scenario"]}, key=scenario_rank):
        first.setdefault(scenario.partition("-")[0], scenario)
    return [
        example
        for scenario in first.values()
        for example in _examples(choose(answers, headline=True, scenario=scenario), files[scenario])
    ]


def _examples(answers: pd.DataFrame, file: PairFile) -> list[Example]:
    answers = answers.sort_values("method", key=ranks, kind="stable")
    there = [method for method in CHOOSERS if method in {*answers["method"]}]
    chooser = answers["method"] == (there[0] if there else answers["method"].iloc[-1])
    answers = pd.concat([answers[chooser], answers[~chooser]])
    examples = []
    for choice, pair in choose_pairs(answers[: int(chooser.sum())]).items():
        source, target, _ = known_pair(file, pair)
        here = choose(answers, pair=pair)
        group = str(here["group"].iloc[0])
        example = Example(file.scenario, choice, pair, group, file.unit, source, target, here)
        examples.append(example)
    return examples


def choose_pairs(answers: pd.DataFrame) -> dict[str, int]:
    """Find the pairs of smallest, (lower) median and largest rotation error; first of equals."""
    ordered = answers.sort_values("error_r_deg", kind="stable")["pair"].tolist()
    return {"best": ordered[0], "median": ordered[(len(ordered) - 1) // 2], "worst": ordered[-1]}


def known_pair(file: PairFile, pair: int) -> tuple[Cloud, Cloud, Pose]:
    """Give a test pair's source and target, each in its own frame, and T_target_source.

    Raises:
        ValueError: The file has no such test pair.
    """
    test = file.test
    if not 0 <= pair < len(test):
        raise ValueError(f"{file.scenario} needs a test pair {pair}, it has {len(test)}")
    source, target, pose = (
        some[pair].double().numpy() for some in (test.source, test.target, test.T_target_source)
    )
    return source, target, pose


def pose_of(answer: Mapping[str, Any]) -> Pose:
    """Give the estimated T_target_source of an answer."""
    pose = np.eye(4)
    pose[:3] = np.reshape([answer[name] for name in POSE], (3, 4))
    return pose


def move(T_target_source: Pose, source: Cloud) -> Cloud:
    """Carry points of the source frame into the target frame."""
    return np.asarray(source @ T_target_source[:3, :3].T + T_target_source[:3, 3])


def describe(answer: Mapping[str, Any], unit: str) -> str:
    """Say in words how far off one registration is."""
    said = (
        f"{shown(answer['method']).name}: rotation off by {answer['error_r_deg']:.3g}°,"
        f" translation by {answer['error_t']:.3g} ({unit})"
    )
    return said + (" (failed: identity pose shown)" if answer["failed"] else "")


def thin(points: Cloud, most: int = 2048) -> Cloud:
    """Keep at most so many points, evenly by index."""
    return np.asarray(points[thinned(len(points), most)])


def scene_data(
    examples: Sequence[Example],
    walks: Mapping[str, Sequence[RecordedWalk]],
    files: Mapping[str, PairFile],
) -> dict[str, Any]:
    """Collect what the page moves: each cloud once, and poses as their twelve upper numbers.

    Returns:
        ``clouds`` by ``<scenario>/<pair>``, ``examples`` by scenario and choice, ``walks`` by
        scenario.

    Raises:
        ValueError: A pair file lacks a pair that was walked.
    """
    scenes: dict[str, Any] = {"clouds": {}, "examples": {}, "walks": {}}
    for one in examples:
        key = f"{one.scenario}/{one.pair}"
        scenes["clouds"][key] = _rounded(one.source, one.target)
        scenes["examples"].setdefault(one.scenario, {})[one.choice] = _choice(one)
    for scenario, some in sorted(walks.items()):
        scenes["walks"][scenario] = [_walk(walk, files[scenario]) for walk in some]
        for walk in some:
            source, target, _ = known_pair(files[scenario], walk.pair)
            scenes["clouds"].setdefault(f"{scenario}/{walk.pair}", _rounded(source, target))
    return scenes


def _rounded(source: Cloud, target: Cloud) -> dict[str, list[list[float]]]:
    """Round both clouds to a thousandth of the target's extent, as the eye sees."""
    extent = float(np.ptp(target, axis=0).max()) or 1.0
    decimals = 3 - int(np.floor(np.log10(extent)))
    source, target = (np.round(thin(points), decimals).T for points in (source, target))
    return {"source": source.tolist(), "target": target.tolist()}


def _choice(example: Example) -> dict[str, Any]:
    poses = {
        answer["method"]: {"pose": flat(pose_of(answer)), "says": describe(answer, example.unit)}
        for answer in example.answers.to_dict("records")
    }
    return {"pair": example.pair, "group": example.group, "poses": poses}


def _walk(walk: RecordedWalk, file: PairFile) -> dict[str, Any]:
    _, _, truth = known_pair(file, walk.pair)
    noisy, predicted = (
        [
            {"pose": flat(pose), "off": off}
            for pose, off in zip(poses, errors(poses, truth), strict=True)
        ]
        for poses in (walk.noisy, walk.predicted)
    )
    return {
        "method": walk.method, "name": shown(walk.method).name, "pair": walk.pair,
        "group": file.test.group[walk.pair], "times": [*walk.times],
        "noisy": noisy, "predicted": predicted,
    }  # fmt: skip


def flat(pose: Pose) -> list[float]:
    """Write the upper three rows of a pose, row by row, to five decimals."""
    return [float(value) for value in np.round(pose[:3].ravel(), 5)]


def errors(estimates: Float64[np.ndarray, "steps 4 4"], truth: Pose) -> list[list[float]]:
    """Measure each pose: rotation error in degrees, translation error in the clouds' unit."""
    given = torch.from_numpy(np.ascontiguousarray(estimates))
    wanted = torch.from_numpy(truth).expand(len(given), 4, 4)
    off = torch.stack([error_r_deg(given, wanted), error_t(given, wanted)], dim=-1).tolist()
    return [[float(f"{value:.3g}") for value in both] for both in off]
