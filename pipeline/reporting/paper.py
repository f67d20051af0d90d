"""What the paper prints (``paper.csv``), and how reports name and order methods and settings."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pandas as pd

from pipeline.settings.catalogue import CATALOGUE

ACCURACY = ("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t", "error_r_deg", "error_t")
MAE_AND_ERROR, ERRORS = ACCURACY[2:], ACCURACY[4:]
UNSEEN_OBJECTS = "modelnet40-unseen_objects"


@dataclass(frozen=True)
class Shown:
    """How a method appears in a report."""

    name: str
    kind: Literal["floor", "classical", "learned"]


METHODS = {
    name: Shown(entry.shown, entry.kind if entry.kind in ("floor", "classical") else "learned")
    for name, entry in CATALOGUE.items()
}
"""The methods in the order of their rows; one that is not here follows under its own name."""
FLOORS = tuple(name for name, entry in CATALOGUE.items() if entry.kind == "floor")


@dataclass(frozen=True)
class Place:
    """Where a scenario or an ablation stands in the paper."""

    table: str
    title: str


SCENARIOS = {  # the order of the tables; a scenario that is not here is an extra one
    UNSEEN_OBJECTS: Place("1a", "ModelNet40, unseen objects"),
    "modelnet40-unseen_categories": Place("1b", "ModelNet40, unseen categories"),
    "modelnet40-gaussian_noise": Place("1c", "ModelNet40, Gaussian noise"),
    "modelnet40-partial": Place("1d", "ModelNet40, partial overlap"),
    "kitti": Place("2", "KITTI"),
    "3dmatch": Place("2", "3DMatch"),
    "modelnet40-resampled": Place("extra", "ModelNet40, sampled independently"),
    "modelnet40-rpm": Place("extra", "ModelNet40, RPM-Net's protocol"),
    "modelnet40-so3": Place("extra", "ModelNet40, any rotation"),
    "modelnet40-so3_partial": Place("extra", "ModelNet40, any rotation, partial overlap"),
    "modelnet40-meshes": Place("extra", "ModelNet40, the original meshes"),
    "modelnet40-normal_resampled": Place("extra", "ModelNet40, points with normals"),
    "3dmatch-pairs": Place("extra", "3DMatch, overlapping fragments"),
    "kitti-pairs": Place("extra", "KITTI, overlapping scans"),
}
ABLATIONS = {  # by the stem of the file under results/ablations: also what it varies first
    "diffusion": Place("3", "With and without diffusion"),
    "representation": Place("4", "What is diffused"),
    "fusion": Place("5", "Where the noisy pose is fused"),
    "steps": Place("7", "Sampling steps"),
    "hypotheses": Place("extra", "Several starts, the answer chosen without the truth"),
    "noise": Place("extra", "Noise added at the test"),
    "starts": Place("extra", "Starts to success"),
}
TIMING = Place("6", "Accuracy and speed")
VALUES = {  # the order of an ablation's values where it is not their natural one
    "sampler": ("ddpm", "ddim"),
    "diffusion": ("without", "with"),
    "representation": (
        "quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix",
    ),
    "scaling": ("raw", "standardised"),
    "fusion": ("concat", "target", "source"),
}  # fmt: skip
VARIED = ["steps", "hypotheses", "noise", "starts", *VALUES]
"""What ablations vary: the keys of their settings."""
CONCAT = "fusion=concat"
"""The setting of a row of Table 5 that the paper names and prints no numbers for."""
BOUND = 1e-10
"""What Table 6 prints as "< 1e-10" s is a bound."""
RIVALS = {
    "pcrdiffusion_cf": ("pointnetlk", "pcrnet", "fmr"),
    "pcrdiffusion_cb": ("icp", "fgr", "deepgmr", "dcp_v2", "rpmnet"),
}
"""The paper's own division of what it compares with, in its order of rows."""
PRINTED_AT = ["table", "scenario", "method", "setting", "metric"]
"""The columns that say which of the paper's numbers one is."""


def read_printed() -> pd.DataFrame:
    """Read the paper's Tables 1 to 7, one number a row: ``PRINTED_AT`` and ``paper``.

    Angles are in degrees. Table 2 prints one row "PCRDiffusion" and does not say which; it stands
    beside CB here. Table 5 prints no numbers for ``fusion=concat``. Table 6 repeats the accuracy of
    Table 1 (a); its time of CF, "< 1e-10" s, is a bound.
    """
    wide = pd.read_csv(Path(__file__).with_name("paper.csv"), dtype=str, keep_default_na=False)
    cells = wide.melt(PRINTED_AT[:4], var_name="metric", value_name="paper")
    return cells[cells["paper"] != ""].astype({"paper": float})


PRINTED = read_printed()
_PRINTED: dict[tuple[str, ...], float] = PRINTED.set_index(PRINTED_AT)["paper"].to_dict()


def printed(
    table: str, scenario: str, method: str, setting: str = "paper", metric: str = "error_r_deg"
) -> float | None:
    """Give one of the paper's numbers, or None where it prints none."""
    return _PRINTED.get((table, scenario, method, setting, metric))


def shown(method: str) -> Shown:
    """Give a method's name and kind; one nobody has named counts as learned."""
    return METHODS.get(method, Shown(method, "learned"))


def method_rank(method: str) -> tuple[int, str]:
    """Sort key that puts methods in the order of the rows."""
    return [*METHODS, method].index(method), method


def scenario_rank(scenario: str) -> tuple[int, str]:
    """Sort key that puts scenarios in the order of the tables."""
    return [*SCENARIOS, scenario].index(scenario), scenario


def place(scenario: str) -> Place:
    """Give a scenario's table and title; one the paper does not have is ``extra``."""
    return SCENARIOS.get(scenario, Place("extra", scenario))


def varied(setting: str) -> dict[str, str]:
    """Read what a setting of an ablation sets, as in ``steps=4,sampler=ddim``."""
    return dict(part.split("=", 1) for part in setting.split(",") if "=" in part)


def source_of(setting: str) -> str:
    """Give what a setting of the ablation of starts says beside their number, often nothing."""
    return ",".join(part for part in setting.split(",") if not part.startswith("starts="))


def named(method: str, setting: str) -> str:
    """Name a method in a setting of its own; the paper's needs no name."""
    aside = "" if setting in ("", "paper") else f", {setting.replace('_', ' ')}"
    return f"{shown(method).name}{aside}"


def setting_rank(setting: str) -> tuple[list[int], list[tuple[float, str]]]:
    """Sort key that puts an ablation's settings in the order of the paper's rows.

    Numbers are compared as such: ``steps=16`` follows ``steps=8``.
    """
    values = varied(setting)
    ranks = [
        [*order, values[name]].index(values[name]) if name in values else 0
        for name, order in VALUES.items()
    ]
    parts = re.split(r"(\d+(?:\.\d+)?)", setting)
    return ranks, [(float(part), "") if part[:1].isdigit() else (-1, part) for part in parts]


def in_order(methods: Iterable[str]) -> list[str]:
    """List methods once each, in the order of the rows."""
    return sorted({*methods}, key=method_rank)
