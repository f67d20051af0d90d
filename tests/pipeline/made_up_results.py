"""Made-up results, curves and pair files, in the form the stages before the report write."""

import csv
import json
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from pcrdiff.registration import SPLITS, Pairs
from pipeline import artifacts
from pipeline.paper import UNSEEN_OBJECTS
from pipeline.result_files import COLUMNS, EULER, POSE, SHIFT

ROTATION_ERROR_DEG = {
    "identity": 25.0,
    "constant": 12.0,
    "icp_centroid": 0.0,
    "icp": 9.0,
    "fgr": 2.0,
    "pcrdiffusion_cf": 4.0,
    "pcrdiffusion_cb": 1.0,
}
"""Standard deviation of the made-up error of each Euler angle."""
SCENARIOS = (
    UNSEEN_OBJECTS,
    "modelnet40-unseen_categories",
    "modelnet40-gaussian_noise",
    "modelnet40-partial",
    "3dmatch",
    "kitti",
)
GROUPS = ("airplane", "bottle", "chair", "vase")
LEARNED = ("pcrdiffusion_cf", "pcrdiffusion_cb")


def write_everything(folder: Path, scenarios: tuple[str, ...] = SCENARIOS, pairs: int = 12) -> None:
    """Write ``results``, ``models`` and ``pairs`` for the methods above under ``folder``."""
    for number, scenario in enumerate(scenarios):
        generator = np.random.default_rng(number)
        poses = random_poses(pairs, generator)
        write_pairs(folder / "pairs", scenario, poses, generator)
        for method, deviation in ROTATION_ERROR_DEG.items():
            rows = score_rows(poses, deviation, "paper", generator)
            write_rows(folder / "results" / scenario / f"{method}.csv", rows)
        for method in LEARNED:
            write_training(folder / "models" / scenario, method, generator)
    if UNSEEN_OBJECTS in scenarios:
        write_steps(folder / "results" / "ablations", pairs)


def write_steps(folder: Path, pairs: int) -> None:
    """Write the ablation over sampling steps."""
    generator = np.random.default_rng(99)
    poses = random_poses(pairs, generator)
    steps = [
        {"method": "pcrdiffusion_cf", **row}
        for step, deviation in ((1, 4.0), (2, 3.5), (4, 3.4), (16, 3.4))
        for row in score_rows(poses, deviation, f"steps={step}", generator)
    ]
    write_rows(folder / "steps.csv", steps)


def random_poses(count: int, generator: np.random.Generator) -> np.ndarray:
    """Draw poses as the paper does: each Euler angle in [0, 45] degrees, each shift in [0, 1]."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    angles = generator.uniform(0, 45, (count, 3))
    poses[:, :3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    poses[:, :3, 3] = generator.uniform(0, 1, (count, 3))
    return poses


def score_rows(
    poses: np.ndarray, deviation_deg: float, setting: str, generator: np.random.Generator
) -> list[dict[str, object]]:
    """Disturb true poses and write down how far off they are, as the evaluate stage does."""
    rows: list[dict[str, object]] = []
    for pair, pose in enumerate(poses):
        truth = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", degrees=True)
        off, shift = generator.normal(0, deviation_deg, 3), generator.normal(0, 1, 3)
        shift *= deviation_deg / 60
        estimate = np.eye(4)
        estimate[:3, :3] = Rotation.from_euler("xyz", truth + off, degrees=True).as_matrix()
        estimate[:3, 3] = pose[:3, 3] + shift
        between = Rotation.from_matrix(estimate[:3, :3].T @ pose[:3, :3])
        numbers = [
            float(np.degrees(between.magnitude())) if deviation_deg else 0.0,
            float(np.linalg.norm(shift)),
            *map(float, off),
            *map(float, shift),
            *map(float, estimate[:3].ravel()),
        ]
        texts = [pair, pair, GROUPS[pair % len(GROUPS)], setting, "", *map(repr, numbers)]
        rows.append(dict(zip(COLUMNS, texts, strict=True)))
    return rows


def plain_row(
    pair: int = 0, *, group: str = "chair", off_deg: float = 0.0, shift: float = 0.0
) -> dict[str, object]:
    """Give the row of a pair whose every angle and shift is off by the same known amount."""
    row: dict[str, object] = dict.fromkeys((*EULER,), repr(off_deg))
    row |= dict.fromkeys(SHIFT, repr(shift))
    row |= {name: repr(float(name in ("T00", "T11", "T22"))) for name in POSE}
    row |= {"error_r_deg": repr(2 * off_deg), "error_t": repr(3 * shift)}
    row |= {"pair": pair, "item": pair, "group": group, "setting": "paper", "failure": ""}
    return {name: row[name] for name in COLUMNS}


def write_rows(file: Path, rows: list[dict[str, object]]) -> Path:
    """Write a result file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return file


def write_training(folder: Path, method: str, generator: np.random.Generator) -> None:
    """Write a training curve that falls, and its budget."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{method}.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(
            ["epoch", "step", "learning_rate", "loss", "val_error_r_deg", "val_error_t"]
        )
        for epoch in range(1, 31):
            loss = 2 / epoch * generator.uniform(0.8, 1.2)
            errors = (20 * loss, loss / 3) if epoch % 2 == 0 else ("", "")
            writer.writerow([epoch, 38 * epoch, 1e-3, loss, *errors])
    budget = {"epochs": 30, "steps": 1140, "batch_size": 32, "train_pairs": 1216}
    budget |= {"parameters": 4231111, "best_epoch": 28}
    (folder / f"{method}.json").write_text(json.dumps(budget))


def write_pairs(
    folder: Path, scenario: str, poses: np.ndarray, generator: np.random.Generator
) -> None:
    """Write a pair file whose splits are all the test split: it is all the report reads."""
    source = np.stack([cloud(scenario, 1024, generator) for _ in range(len(poses))]).astype(
        np.float32
    )
    target = source @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
    group = tuple(GROUPS[pair % len(GROUPS)] for pair in range(len(poses)))
    pairs = Pairs(
        torch.from_numpy(source),
        torch.from_numpy(target.astype(np.float32)),
        torch.from_numpy(poses),
        torch.arange(len(poses)),
        group,
    )
    attributes = {
        "scenario": scenario,
        "unit": "unit sphere" if scenario.startswith("modelnet40") else "m",
        "seed": 7,
        "provenance": {"source": "synthetic", "root": "/somewhere/raw", "max_rotation_deg": 45.0},
    }
    splits = dict.fromkeys(SPLITS, pairs)
    artifacts.write_pairs(folder / f"{scenario}.h5", splits, "category", attributes)


def cloud(scenario: str, count: int, generator: np.random.Generator) -> np.ndarray:
    """Draw a chair, the corner of a room, or a street, by the data set."""
    shapes: dict[str, list[tuple[tuple[float, ...], tuple[float, ...]]]] = {
        "modelnet40": [((-0.5, -0.5, 0), (0.5, 0.5, 0.1)), ((-0.5, 0.4, 0.1), (0.5, 0.5, 0.8))],
        "3dmatch": [((0, 0, 0), (3, 2.5, 0.02)), ((0, 0, 0), (0.02, 2.5, 2.2)),
                    ((0, 2.5, 0), (3, 2.52, 2.2)), ((1, 0.8, 0), (2, 1.6, 0.8))],
        "kitti": [((-40, -15, -1.7), (40, 15, -1.6)), ((-30, 10, -1.7), (25, 12, 6)),
                  ((8, 2, -1.7), (12, 4, 0)), ((-20, -6, -1.7), (-16, -4, 0)),
                  ((-35, -14, -1.7), (35, -13, 5))],
    }  # fmt: skip
    boxes = shapes[scenario.partition("-")[0]]
    corners = np.array(boxes, dtype=float)
    low, high = corners[generator.integers(len(boxes), size=count)].transpose(1, 0, 2)
    return np.asarray(generator.uniform(low, high))


def make_report_inputs(folder: Path) -> list[str]:
    """Give the stage's arguments for inputs under ``folder`` and outputs beside them."""
    reports = folder / "reports"
    flags = {
        "results": folder / "results",
        "models": folder / "models",
        "pairs": folder / "pairs",
        "table": reports / "results.csv",
        "markdown": reports / "results.md",
        "page": reports / "index.html",
        "figures": reports / "figures",
        "summary": reports / "summary.json",
    }
    return [text for name, value in flags.items() for text in (f"--{name}", str(value))]
