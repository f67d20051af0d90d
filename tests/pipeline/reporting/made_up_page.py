"""A made-up page with everything on it: findings, walks, studies and every method of the paper."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pipeline.formats.pairs import read_pairs
from pipeline.formats.walks import Walk
from pipeline.reporting.background import Training, read_pair_files, read_trainings
from pipeline.reporting.findings import Finding
from pipeline.reporting.overlays import make_overlays, pick_walked_pairs
from pipeline.reporting.page import Contents
from pipeline.reporting.paper import METHODS, UNSEEN_OBJECTS, Number, printed
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.result_files import read_results
from pipeline.reporting.tables import Row, make_rows
from pipeline.reporting.views import banner, make_tables
from tests.pipeline.reporting.made_up_benchmarks import make_benchmarks
from tests.pipeline.reporting.made_up_results import (
    ROTATION_ERROR_DEG,
    SCENARIOS,
    result_file,
    score_rows,
    write_everything,
    write_rows,
)

CF, CB = "pcrdiffusion_cf", "pcrdiffusion_cb"
FINDINGS = (
    Finding(
        "order of methods",
        "PCRDiffusion CB has the smallest ERROR(R) on unseen objects: 1.2732 deg.",
        ("Ours is 1.31 deg [1.12, 1.52]; the next best, RPMNet, 2.90 deg [2.40, 3.51].",),
        "confirmed",
    ),
    Finding(
        "diffusion",
        "Without diffusion CF falls from 3.2786 to 168.0197 deg.",
        ("Ours falls from 4.02 deg [3.51, 4.55] to 4.40 deg [3.90, 4.93].", "0.38 deg apart."),
        "not confirmed",
    ),
    Finding("steps", "One step is as good as eight.", ("0.04 deg [-0.10, 0.18].",), "undecided"),
    Finding("speed", "CB is the fastest with correspondences.", (), "not run"),
)
PROVENANCE = Provenance(
    revision="0123456789abcdef0123456789abcdef01234567",
    changed=("params.yaml",),
    digests={"data/pairs/kitti.h5": "d" * 32, "results/icp": "e" * 32},
    python="3.11.9",
    packages={"numpy": "2.0.0", "torch": "2.4.0"},
)


def make_contents(
    folder: Path, scenarios: tuple[str, ...] = SCENARIOS, pairs: int = 12
) -> Contents:
    """Write made-up inputs under ``folder`` and read them as the report does, and more."""
    write_everything(folder, scenarios, pairs)
    for scenario in scenarios:
        _write_other_methods(folder / "results", folder / "pairs", scenario)
    scores = read_results(folder / "results")
    trainings = read_trainings(folder / "models")
    files = read_pair_files(folder / "pairs", scenarios)
    facts = {name: file.facts for name, file in files.items()}
    rows = make_rows(scores, seed=0)
    others = [row for row in rows if row.table != "7"]  # whose rows come with the studies'
    walks = {name: _walks(folder / "pairs", name) for name in scenarios if name != "3dmatch"}
    return Contents(
        rows=[*others, *study_rows()] if UNSEEN_OBJECTS in scenarios else rows,
        tables=make_tables(rows, trainings, facts),
        overlays=make_overlays(scores, files),
        trainings=[*trainings, *_ablation_trainings()],
        facts=facts,
        profile="quick",
        banner=banner("quick", facts.values()),
        findings=FINDINGS,
        walks=walks,
        walked=pick_walked_pairs(walks, files),
        scores=scores,
        provenance=PROVENANCE,
        benchmarks=make_benchmarks(),
    )


def _write_other_methods(results: Path, pairs: Path, scenario: str) -> None:
    poses = read_pairs(pairs / f"{scenario}.h5", "test").T_target_source.numpy()
    generator = np.random.default_rng(len(scenario))
    for number, method in enumerate(METHODS):
        if method not in ROTATION_ERROR_DEG:
            rows = score_rows(poses, 0.5 * 1.3**number, "paper", generator)
            write_rows(result_file(results, scenario, method), rows)


def _ablation_trainings() -> list[Training]:
    budget = {"epochs": 10, "steps": 380, "batch_size": 32, "train_pairs": 1216}
    settings = ("representation=euler,scaling=raw", "representation=twist,scaling=standardised")
    return [Training(UNSEEN_OBJECTS, CB, budget, {}, (setting,)) for setting in settings]


def _walks(pairs: Path, scenario: str) -> list[Walk]:
    """Walk two pairs from a wrong pose to nearly the true one, under both diffusions."""
    truth = read_pairs(pairs / f"{scenario}.h5", "test").T_target_source.numpy()
    return [_walk(method, pair, truth[pair]) for method in (CB, CF) for pair in (0, 2)]


def _walk(method: str, pair: int, truth: np.ndarray) -> Walk:
    times = tuple(range(1000, 0, -125))
    start = Rotation.from_euler("xyz", [70, -40 + 10 * pair, 30], degrees=True)
    ends = Rotation.concatenate([start, Rotation.from_matrix(truth[:3, :3])])
    poses = {}
    for kind, lag in (("noisy", 1.0), ("predicted", 0.3)):
        left = lag * np.array(times) / 1000
        poses[kind] = np.tile(np.eye(4), (len(times), 1, 1))
        poses[kind][:, :3, :3] = Slerp([0, 1], ends)(1 - left).as_matrix()
        poses[kind][:, :3, 3] = truth[:3, 3] + left[:, None] * np.array([1.0, -0.5, 0.8])
    return Walk(method, pair, times, poses["noisy"], poses["predicted"])


def row(table: str, method: str, setting: str, metric: str, value: float) -> Row:
    """Make one row on unseen objects, its interval a fifth to either side, the paper's beside."""
    number = Number(table, UNSEEN_OBJECTS, method, setting, metric)
    low, high = 0.8 * value, 1.2 * value
    names = (table, UNSEEN_OBJECTS, "all", method, setting, metric)
    return Row(*names, value, low, high, printed(number), 12, 0)


def study_rows() -> list[Row]:
    """Make the rows of Tables 3 to 7 and those against rotation, overlap and noise."""
    return [*_ablation_rows(), *_steps_rows(), *_speed_rows(), *_hard_rows()]


def _errors(table: str, method: str, setting: str, rotation: float) -> list[Row]:
    return [
        row(table, method, setting, "error_r_deg", rotation),
        row(table, method, setting, "error_t", rotation / 80),
    ]


def _ablation_rows() -> Iterator[Row]:
    for method, values in ((CF, (4.4, 4.0)), (CB, (1.6, 1.3))):
        for setting, value in zip(("without", "with"), values, strict=True):
            yield from _errors("3", method, f"diffusion={setting}", value)
    names = ("quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix")
    for number, name in enumerate(names):
        for scaling in ("raw", "standardised"):
            setting = f"representation={name},scaling={scaling}"
            yield from _errors("4", CB, setting, 1.3 + number * (0.4 + (scaling == "raw")))
    for fusion, value in (("source", 4.0), ("target", 4.1), ("concat", 30.0)):
        yield from _errors("5", CF, f"fusion={fusion}", value)
    for starts in (1, 2, 4, 8):
        yield from _errors("extra", CF, f"hypotheses={starts}", 4 - starts / 8)


def _steps_rows() -> Iterator[Row]:
    generator = np.random.default_rng(3)
    for steps in (1, 2, 4, 8, 16):
        for sampler in ("ddpm", "ddim"):
            base = 3.6 if sampler == "ddpm" else 3.2
            setting = f"steps={steps},sampler={sampler}"
            rows = _errors("7", CF, setting, base)
            printed_there = sampler == "ddpm" and steps < 16
            yield from (replace(r, paper=0.9 * r.value if printed_there else None) for r in rows)
            for draw in (1, 2, 3):
                spread = base * generator.uniform(0.92, 1.08)
                yield from _errors("7", CF, f"{setting},draw={draw}", spread)


def _speed_rows() -> Iterator[Row]:
    for number, method in enumerate(METHODS):
        error = 0.5 + 0.9 * number
        yield row("6", method, "paper", "error_r_deg", error)
        yield row("6", method, "paper", "seconds", 0.002 * 1.45 ** ((7 * number) % 20))
        yield row("6", method, "paper", "peak_memory_mib", 4 + 17 * ((3 * number) % 20))


def _hard_rows() -> Iterator[Row]:
    bins: dict[str, Sequence[float]] = {
        **{f"rotation_deg={low}-{low + 15}": (low / 10, 0.2) for low in range(0, 75, 15)},
        **{f"overlap=0.{tenth}-0.{tenth + 1}": (9 - tenth, 0.1) for tenth in range(4, 9)},
        **{f"noise={deviation}": (100 * deviation, 0.1) for deviation in (0.01, 0.02, 0.05)},
    }
    for number, method in enumerate(METHODS):
        for setting, (growth, start) in bins.items():
            error = start * (1 + number) * (1 + growth)
            yield from _errors("extra", method, setting, error)
            yield row("extra", method, setting, "median_error_r_deg", 0.6 * error)
            yield row("extra", method, setting, "below_5_deg_percent", 80 / (1 + error / 5))
