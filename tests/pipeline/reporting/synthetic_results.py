"""Synthetic results, curves and pair files, in the form the stages before the report write."""

import csv
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from pcrdiff.registration import EVIDENCE, SPLITS, Pairs
from pcrdiff.verdict import Verdict
from pipeline.formats.answers import ANSWER, JUDGED, POSE
from pipeline.formats.files import write_csv
from pipeline.formats.pairs import Streamed
from pipeline.formats.pairs import write_pairs as write_pairs_file
from pipeline.formats.verdicts import VERDICTS, write_verdicts
from pipeline.formats.walks import RecordedWalk
from pipeline.formats.walks import write_walks as write_the_walks
from pipeline.reporting.paper import UNSEEN_OBJECTS, VALUES
from pipeline.reporting.reading import EULER, SHIFT

ROTATION_ERROR_DEG = {
    "identity": 25.0,
    "constant": 12.0,
    "icp_centroid": 0.0,
    "icp": 9.0,
    "fgr": 2.0,
    "pcrdiffusion_cf": 4.0,
    "pcrdiffusion_cb": 1.0,
}
"""Standard deviation of the synthetic error of each Euler angle."""
SCENARIOS = (
    UNSEEN_OBJECTS,
    "modelnet40-unseen_categories",
    "modelnet40-gaussian_noise",
    "modelnet40-partial",
    "3dmatch",
    "kitti",
)
EVERY_METHOD = ROTATION_ERROR_DEG | {
    "trimmed_icp": 0.3,
    "gicp": 1.5,
    "ransac_fpfh": 0.6,
    "small_gicp": 0.2,
    "kiss_matcher": 0.4,
    "pointnetlk": 3.0,
    "pcrnet": 7.0,
    "deepgmr": 2.5,
    "dcp_v1": 6.0,
    "dcp_v2": 5.0,
    "fmr": 3.2,
    "rpmnet": 1.4,
    "egst": 1.2,
    "gicp_multistart": 0.5,
    "pcrdiffusion_cb_moved": 0.9,
    "ransac_multistart": 0.8,
    "sc2_pcr": 0.5,
}
"""The same for all rows of the tables; a few suffice for most tests."""
ABLATED = {
    "diffusion": {
        "pcrdiffusion_cf": {"diffusion=with": 4.0, "diffusion=without": 4.1},
        "pcrdiffusion_cb": {"diffusion=with": 1.0, "diffusion=without": 1.0},
    },
    "representation": {
        "pcrdiffusion_cb": {
            f"representation={name},scaling={scaling}": 1.0 + 0.2 * number + 0.1 * len(scaling)
            for number, name in enumerate(VALUES["representation"])
            for scaling in VALUES["scaling"]
        }
    },
    "fusion": {"pcrdiffusion_cf": {"fusion=source": 4.0, "fusion=target": 4.0, "fusion=concat": 9}},
    "steps": {
        method: {
            f"steps={steps},sampler={sampler}{draw}": deviation * (1 + 0.2 / steps)
            for steps in (1, 2, 4, 8, 16)
            for sampler in VALUES["sampler"]
            for draw in ("", ",draw=1", ",draw=2")
        }
        for method, deviation in (("pcrdiffusion_cf", 4.0), ("pcrdiffusion_cb", 1.0))
    },
    "hypotheses": {
        "pcrdiffusion_cf": {f"hypotheses={k}": 4.0 - 0.2 * i for i, k in enumerate((1, 4, 16))}
    },
    "noise": {
        method: {f"noise={sd}": deviation + 100 * sd for sd in (0.0, 0.005, 0.01, 0.02, 0.04)}
        for method, deviation in (("icp", 9.0), ("fgr", 2.0), ("pcrdiffusion_cb", 1.0))
    },
}
"""By ablation, method and setting, the standard deviation of the error of each Euler angle."""
STARTED = {
    "gicp_multistart": {f"starts={k}": 40 / k for k in (1, 2, 4, 8, 16, 64)},
    "pcrdiffusion_cf": {f"paper,starts={k}": 9 / k for k in (1, 4, 16)},
    "pcrdiffusion_cb_moved": {
        f"{walk},starts={k}": off / k
        for walk, off in (("one_step", 12), ("four_steps", 5))
        for k in (1, 2, 4)
    },
}
"""The same of the ablation of starts, by their source."""
TRAINED = ("diffusion", "representation", "fusion")
"""Ablations that train for each of their values."""
VERIFIED = "gicp_multistart"
"""The method that says how sure it is."""
GROUPS = ("airplane", "bottle", "chair", "vase")
LEARNED = ("pcrdiffusion_cf", "pcrdiffusion_cb")


def write_everything(
    folder: Path,
    scenarios: tuple[str, ...] = SCENARIOS,
    pairs: int = 12,
    methods: Mapping[str, float] = ROTATION_ERROR_DEG,
) -> None:
    """Write ``results``, ``models`` and ``pairs`` for some methods under ``folder``."""
    results, models = folder / "results", folder / "models"
    for number, scenario in enumerate(scenarios):
        generator = np.random.default_rng(number)
        poses = random_poses(pairs, generator)
        write_pairs(folder / "pairs", scenario, poses, generator)
        for method, deviation in methods.items():
            rows = score_rows(poses, deviation, "paper", generator)
            write_rows(result_file(results, scenario, method), rows)
        for method in LEARNED:
            write_training(models / method / scenario, generator, scenario=scenario, method=method)
            write_walks(results / "walks" / scenario / f"{method}.csv", method, poses, generator)
    if UNSEEN_OBJECTS in scenarios:
        write_ablations(results / "ablations", pairs)
        write_ablated_trainings(models / "ablations")
        for method in methods:
            write_times(results / "times" / f"{method}.csv", method, min(pairs, 5))


def write_verified(results: Path, scenario: str, pairs: int) -> None:
    """Write the answers of ``VERIFIED``, in two settings, each with its probability and verdict."""
    generator = np.random.default_rng(97)
    poses, rows = random_poses(pairs, generator), list[dict[str, object]]()
    for setting, deviation in (("official", 2.0), ("fast", 6.0)):
        answers = score_rows(poses, deviation, setting, generator)
        rows += [judged(row, p) for row, p in zip(answers, generator.random(pairs), strict=True)]
    write_rows(result_file(results, scenario, VERIFIED), rows)
    settings = {"official": verdict_from(0.25), "fast": verdict_from(None)}
    write_verdicts(results / VERIFIED / VERDICTS / f"{scenario}.json", settings)


def judged(row: dict[str, object], probability: float) -> dict[str, object]:
    """Give a row what speaks for its answer, and a probability."""
    return row | dict.fromkeys(JUDGED, "0.5") | {"probability": repr(float(probability))}


def verdict_from(threshold: float | None) -> Verdict:
    """A verdict that trusts from a probability on, fitted to twenty answers of which 15 were right."""
    zeros, ones = (0.0,) * len(EVIDENCE), (1.0,) * len(EVIDENCE)
    return Verdict(zeros, ones, zeros, 0.0, threshold, 20, 15)


def result_file(results: Path, scenario: str, method: str) -> Path:
    """Give the file that a method's answers on a scenario are in."""
    return results / method / f"{scenario}.csv"


def write_ablations(folder: Path, pairs: int) -> None:
    """Write a file for each ablation; for the one of noise, one for each method."""
    for name, answers in ABLATED.items():
        if name != "noise":
            write_ablation(folder / f"{name}.csv", answers, pairs)
            continue
        for method, found in answers.items():
            write_ablation(folder / name / f"{method}.csv", {method: found}, pairs)


def write_ablation(file: Path, answers: Mapping[str, Mapping[str, float]], pairs: int) -> None:
    """Write an ablation: by method and setting, answers so far off."""
    generator = np.random.default_rng(99)
    poses = random_poses(pairs, generator)
    rows = [
        {"method": method, **row}
        for method, settings in answers.items()
        for setting, deviation in settings.items()
        for row in score_rows(poses, deviation, setting, generator)
    ]
    write_rows(file, rows)


def write_starts(results: Path, scenarios: tuple[str, ...], pairs: int) -> None:
    """Write the ablation of starts on some scenarios, and its times on the first."""
    for scenario in scenarios:
        write_ablation(results / "ablations" / "starts" / f"{scenario}.csv", STARTED, pairs)
    rows = [
        {"method": method, "pair": pair, "setting": setting, "seconds": repr(seconds)}
        for method, settings in STARTED.items()
        for pair in range(min(pairs, 5))
        for seconds, setting in enumerate(settings, start=1)
    ]
    timed = [{"scenario": scenarios[0], **row, "peak_memory_mib": "5.0"} for row in rows]
    write_rows(results / "times" / "starts.csv", timed)


def write_ablated_trainings(folder: Path) -> None:
    """Write the trainings of the ablations that train."""
    generator = np.random.default_rng(98)
    for name in TRAINED:
        for method, settings in ABLATED[name].items():
            for setting in settings:
                value, *scaling = (part.partition("=")[2] for part in setting.split(","))
                place = folder / name / value / "-".join([method, *scaling])
                write_training(
                    place,
                    generator,
                    scenario=UNSEEN_OBJECTS,
                    method=method,
                    epochs=6,
                    settings=[setting],
                )


def write_times(file: Path, method: str, pairs: int) -> None:
    """Write how long a method took in the paper's setting."""
    generator = np.random.default_rng(len(method))
    typical = generator.uniform(0.5, 1.5) * (0.004 if method in LEARNED else 0.05)
    write_rows(
        file,
        [
            {
                "pair": pair,
                "setting": "paper",
                "seconds": repr(float(typical * generator.uniform(0.8, 1.2))),
                "peak_memory_mib": repr(float(40 * generator.uniform(0.9, 1.1))),
            }
            for pair in range(pairs)
        ],
    )


def write_walks(file: Path, method: str, poses: np.ndarray, generator: np.random.Generator) -> None:
    """Write a walk back in eight steps for each of the first two pairs."""
    times = tuple(range(1000, 0, -125))
    made = [
        RecordedWalk(
            method,
            pair,
            times,
            np.stack([disturbed(pose, time / 1000, generator) for time in times]),
            np.stack([disturbed(pose, time / 9000, generator) for time in times]),
        )
        for pair, pose in enumerate(poses[:2])
    ]
    write_the_walks(file, made)


def disturbed(pose: np.ndarray, share: float, generator: np.random.Generator) -> np.ndarray:
    """Turn and shift a pose at random, by about ``share`` of a radian and of the unit."""
    moved = pose.copy()
    turn = Rotation.from_rotvec(generator.normal(0, share, 3)).as_matrix()
    moved[:3, :3] = turn @ pose[:3, :3]
    moved[:3, 3] += generator.normal(0, share, 3)
    return moved


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
        rows.append(dict(zip(ANSWER, texts, strict=True)))
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
    return {name: row[name] for name in ANSWER}


def write_rows(file: Path, rows: list[dict[str, object]]) -> Path:
    """Write a result file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return file


def write_training(
    folder: Path, generator: np.random.Generator, epochs: int = 30, **told: object
) -> None:
    """Write a training curve that falls, ``curve.csv``, and ``facts.json``."""
    folder.mkdir(parents=True)
    head = ["epoch", "step", "learning_rate", "loss", "val_error_r_deg", "val_error_t"]
    rows: list[list[object]] = []
    for epoch in range(1, epochs + 1):
        loss = 2 / epoch * generator.uniform(0.8, 1.2)
        errors = (20 * loss, loss / 3) if epoch % 2 == 0 else ("", "")
        rows.append([epoch, 38 * epoch, 1e-3, loss, *errors])
    write_csv(folder / "curve.csv", [head, *rows])
    budget = {"epochs": epochs, "steps": 38 * epochs, "batch_size": 32, "train_pairs": 1216}
    budget |= {"parameters": 4231111, "best_epoch": epochs - 2}
    (folder / "facts.json").write_text(json.dumps(budget | told))


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
    streamed = {name: Streamed(len(each), [each]) for name, each in splits.items()}
    write_pairs_file(folder / f"{scenario}.h5", streamed, "category", attributes)


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
        "benchmarks": folder / "benchmarks",
        "tables": reports / "tables",
        "page": reports / "index.html",
        "figures": reports / "figures",
        "summary": reports / "summary.json",
    }
    return [text for name, value in flags.items() for text in (f"--{name}", str(value))]
