"""What a method answered to each pair, as CSV, and where it says so what speaks for the answer."""

from collections.abc import Mapping
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import (
    chamfer_ratio,
    error_r_deg,
    error_t,
    euler_difference_deg,
    translation_difference,
)
from pcrdiff.registration import EVIDENCE, Pairs
from pipeline.formats.files import write_csv

if TYPE_CHECKING:
    from pcrdiff.evaluation import Estimates
    from pcrdiff.verdict import Verdict

POSE = tuple(f"T{row}{column}" for row in range(3) for column in range(4))
ANSWER = ["pair", "item", "group", "setting", "failure", "error_r_deg", "error_t"]
ANSWER += ["rx_deg", "ry_deg", "rz_deg", "tx", "ty", "tz", *POSE]
"""The columns that say what was answered."""
CHAMFER = "chamfer_ratio"
"""The answer's modified Chamfer distance over the true pose's; empty where no shape is known."""
PROBABILITY = "probability"
JUDGED = [*EVIDENCE, PROBABILITY]
"""The last columns: what speaks for the answer, and the probability that it is right.

All are empty for a method that never says, or that failed; the probability also without a verdict.
"""


def write_estimates(
    path: Path,
    truth: Pairs,
    answers: "Mapping[str, Estimates]",
    verdicts: "Mapping[str, Verdict] | None" = None,
) -> None:
    """Write a row per setting and pair: how far off, the answer itself, and how sure it is.

    ``verdicts`` are those of some settings, by their names.
    """
    judged = verdicts or {}
    rows = [
        row
        for setting, given in answers.items()
        for row in _rows(truth, setting, given, judged.get(setting))
    ]
    write_csv(path, [[*ANSWER, CHAMFER, *JUDGED], *rows])


def write_ablation(
    path: Path, truth: Pairs, answers: "Mapping[str, Mapping[str, Estimates]]"
) -> None:
    """Write the same rows for several methods, each led by its method's name."""
    rows = [
        [method, *row]
        for method, settings in answers.items()
        for setting, given in settings.items()
        for row in _rows(truth, setting, given)
    ]
    write_csv(path, [["method", *ANSWER, CHAMFER, *JUDGED], *rows])


def _rows(
    truth: Pairs, setting: str, given: "Estimates", verdict: "Verdict | None" = None
) -> list[list[object]]:
    pose, true_pose = given.T_target_source, truth.T_target_source
    compared = error_r_deg, error_t, euler_difference_deg, translation_difference
    columns = [compare(pose, true_pose) for compare in compared]
    numbers = torch.column_stack([*columns, pose[:, :3].flatten(1)]).tolist()
    behind = [
        [ratio, *told]
        for ratio, told in zip(_ratios(truth, pose), _judged(given, verdict), strict=True)
    ]
    return [
        [k, int(truth.item[k]), truth.group[k], setting, given.failures[k], *numbers[k], *behind[k]]
        for k in range(len(truth))
    ]


def _ratios(truth: Pairs, pose: Tensor) -> list[object]:
    """The field ``CHAMFER`` of each pair."""
    if truth.shape is None:
        return [""] * len(truth)
    clouds = truth.source, truth.target, truth.shape
    return [*chamfer_ratio(pose, truth.T_target_source, *clouds).tolist()]


def _judged(given: "Estimates", verdict: "Verdict | None") -> list[list[object]]:
    """The fields of ``JUDGED`` for each pair, empty where there is no number."""
    evidence = np.full((len(given.failures), len(EVIDENCE)), np.nan)
    if given.evidence is not None:
        evidence = given.evidence.numpy()
    unknown = np.full(len(evidence), np.nan)
    probability = verdict.probability(evidence) if verdict else unknown
    numbers = np.column_stack([evidence, probability]).tolist()
    return [["" if isnan(number) else number for number in row] for row in numbers]
