"""What a method answered to each pair, as CSV."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import torch

from pcrdiff.geometry.metrics import (
    error_r_deg,
    error_t,
    euler_difference_deg,
    translation_difference,
)
from pcrdiff.registration import Pairs
from pipeline.formats.files import write_csv

if TYPE_CHECKING:
    from pcrdiff.evaluation import Estimates


POSE = tuple(f"T{row}{column}" for row in range(3) for column in range(4))
ANSWER = ["pair", "item", "group", "setting", "failure", "error_r_deg", "error_t"]
ANSWER += ["rx_deg", "ry_deg", "rz_deg", "tx", "ty", "tz", *POSE]
"""The columns of a row."""


def write_estimates(path: Path, truth: Pairs, answers: "Mapping[str, Estimates]") -> None:
    """Write a row per setting and pair: how far off, and the answer itself."""
    rows = [row for setting, given in answers.items() for row in _rows(truth, setting, given)]
    write_csv(path, [ANSWER, *rows])


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
    write_csv(path, [["method", *ANSWER], *rows])


def _rows(truth: Pairs, setting: str, given: "Estimates") -> list[list[object]]:
    pose, true_pose = given.T_target_source, truth.T_target_source
    compared = error_r_deg, error_t, euler_difference_deg, translation_difference
    columns = [compare(pose, true_pose) for compare in compared]
    numbers = torch.column_stack([*columns, pose[:, :3].flatten(1)]).tolist()
    return [
        [k, int(truth.item[k]), truth.group[k], setting, given.failures[k], *numbers[k]]
        for k in range(len(truth))
    ]
