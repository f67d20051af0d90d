"""Preprocessing against the loop that a researcher would write: items a second, and memory."""

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import pi
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import h5py
import numpy as np

from pcrdiff.data.modelnet40 import read_items
from pcrdiff.data.raw import RawItem
from pcrdiff.data.scenarios import Corruption, make_pairs
from pcrdiff.data.synthetic.modelnet40 import write_modelnet40
from pipeline.artifacts import Streamed, write_pairs
from pipeline.machine import settle
from pipeline.params import Compute
from pipeline.spreading import spread_over
from pipeline.timing import forget_peak, resident

NUM_POINTS, WORKERS, REPEATS = 2048, 2, 5
NOISY = Corruption(NUM_POINTS, "copies", pi / 4, 1.0, 0.01, 0.05, 1.0, "estimated")
"""The scenario ``modelnet40-gaussian_noise``."""
NUMBER_OF_ITEMS = (400, 1600)
"""What memory is measured at."""


@dataclass(frozen=True)
class Row:
    """One comparison; ``spread`` is the half range of the ratios over the repeats."""

    name: str
    ratio: float
    ours: float
    peer: float
    unit: str
    n: int
    spread: float


def measure() -> list[Row]:
    """Items a second of both on made-up meshes, and on real ones where there are any; memory."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        made_up = folder / "modelnet40"
        write_modelnet40(made_up, train_per_category=8, test_per_category=2, seed=7)
        rows = [_compare("preprocess_vs_loop", read_items(made_up) * 5, folder)]
        if real_meshes().is_dir():
            real = read_items(real_meshes())
            rows.append(_compare("preprocess_vs_loop_real_meshes", real * 12, folder))
        return [*rows, _memory(read_items(made_up), folder)]


def real_meshes() -> Path:
    """Where real meshes of ModelNet40 would lie."""
    told = os.environ.get("PCRDIFF_REAL_DATA")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return (Path(told) if told else beside) / "modelnet40_off"


def ours(items: Sequence[RawItem], out: Path) -> None:
    """Make a pair of each item with two workers, and write the pair file, as the stage does."""
    settle(threads=1)
    spread = spread_over(Compute(workers=WORKERS, scheduler=None), threads=1)
    val, test = len(items) * 8 // 10, len(items) * 9 // 10
    parts = (range(val), range(val, test), range(test, len(items)))
    splits = {
        name: Streamed(len(part), make_pairs(items, part, NOISY, [7], spread=spread))
        for name, part in zip(("train", "val", "test"), parts, strict=True)
    }
    attributes = {"scenario": "noisy", "unit": "unit sphere", "seed": 7, "provenance": {}}
    write_pairs(out, splits, "category", attributes)


def loop(items: Sequence[RawItem], out: Path) -> None:
    """The same work as it is usually written: one file after the other, all of it in lists."""
    from scipy.spatial.transform import Rotation

    from pcrdiff.data.native import open3d

    generator = np.random.default_rng(7)
    sources, targets, poses = [], [], []
    for item in items:
        path = item.read.args[0]  # type: ignore[attr-defined]  # a partial of read_off
        mesh = open3d.io.read_triangle_mesh(path)
        points = np.asarray(mesh.sample_points_uniformly(NUM_POINTS).points)
        points = points - points.mean(axis=0)
        points = points / np.linalg.norm(points, axis=1).max()
        pose = np.eye(4)
        angles = generator.uniform(0, 45, 3)
        pose[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        pose[:3, 3] = generator.uniform(0, 1, 3)
        moved = points @ pose[:3, :3].T + pose[:3, 3]
        noisy = [
            cloud + np.clip(generator.normal(0, 0.01, cloud.shape), -0.05, 0.05)
            for cloud in (points, moved)
        ]
        sources.append(noisy[0])
        targets.append(generator.permutation(noisy[1]))
        poses.append(pose)
    with h5py.File(out, "w") as file:
        file["source"] = np.stack(sources).astype(np.float32)
        file["target"] = np.stack(targets).astype(np.float32)
        file["T_target_source"] = np.stack(poses)


def _compare(name: str, items: Sequence[RawItem], folder: Path) -> Row:
    """Both in turn, over and over, after one of each that does not count."""
    seconds = [
        [_seconds(partial(run, items, folder / "out.h5")) for run in (ours, loop)]
        for _ in range(1 + REPEATS)
    ][1:]
    ratios = [theirs / own for own, theirs in seconds]
    own, theirs = (len(items) / median(column) for column in zip(*seconds, strict=True))
    spread = (max(ratios) - min(ratios)) / 2
    return Row(name, median(ratios), own, theirs, "items/s", len(items), spread)


def _seconds(run: Callable[[], None]) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def _memory(items: Sequence[RawItem], folder: Path) -> Row:
    """How much more each needs for four times the items: the peak of a process of its own."""
    few, many = (list(items) * (n // len(items)) for n in NUMBER_OF_ITEMS)
    grown = [
        _peak(run, many, folder / "out.h5") - _peak(run, few, folder / "out.h5")
        for run in (ours, loop)
    ]
    own, theirs = (max(mib, 1.0) for mib in grown)  # below 1 MiB it is noise
    return Row("preprocess_memory_growth_vs_loop", theirs / own, own, theirs, "MiB", len(many), 0.0)


def _peak(
    run: Callable[[Sequence[RawItem], Path], None], items: Sequence[RawItem], out: Path
) -> float:
    """The highest resident memory of a fresh process that runs it, in MiB."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_run_and_tell, run, list(items), out).result()


def _run_and_tell(
    run: Callable[[Sequence[RawItem], Path], None], items: Sequence[RawItem], out: Path
) -> float:
    run(items[:32], out)
    forget_peak()
    run(items, out)
    return resident("VmHWM")
