"""(iv) Preprocessing beside the loop that a researcher would write: items a second, and memory."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import pi
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.measuring import Comparison, alternate
from pcrdiff.bindings.open3d import open3d
from pcrdiff.datasets.items import RawItem
from pcrdiff.datasets.modelnet40 import read_items
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.pairs.scenarios import Corruption, make_pairs
from pipeline.compute.machine import forget_peak, resident
from pipeline.compute.progress import bar
from pipeline.compute.workers import spread_over
from pipeline.formats.pairs import Streamed, write_pairs
from pipeline.settings.params import Compute
from pipeline.synthetic.modelnet40 import write_modelnet40

NUM_POINTS, WORKERS = 2048, 2
REAL_TIMES = 12  # there are few real ones at hand
MEAN_SIZE = 400_000
"""Least size of a synthetic file in bytes; cut into four, the mean is twice that, as with real ones."""
NOISY = Corruption(NUM_POINTS, "copies", PoseRange(pi / 4, 1.0), 0.01, 0.05, 1.0, "estimated")
"""The scenario ``modelnet40-gaussian_noise``."""
Run = Callable[[Sequence[RawItem], Path], None]
"""Makes pairs of items and writes them."""
NUMBER_OF_ITEMS = (400, 1600)
"""What memory is measured at."""


def measure_preprocessing(repeats: int) -> list[Comparison]:
    """Items per second of both on synthetic meshes, and on real ones where there are any; memory.

    The synthetic meshes are small. The first row is of the same shapes with as many triangles as
    make a file of ModelNet40's mean size.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        small, large = folder / "small", folder / "large"
        write_modelnet40(small, train_per_category=2, test_per_category=1, seed=7)
        for path in bar(sorted(small.glob("*/*/*.off")), "meshes as large as ModelNet40's"):
            refine(path, large / path.relative_to(small))
        found = [
            compare_speed("preprocess_vs_loop", read_items(large) * 3, folder, repeats),
            compare_speed(
                "preprocess_small_meshes_vs_loop", read_items(small) * 6, folder, repeats
            ),
        ]
        if real_meshes().is_dir():
            real = read_items(real_meshes()) * REAL_TIMES
            found.append(compare_speed("preprocess_real_meshes_vs_loop", real, folder, repeats))
        return [*found, compare_memory(read_items(small), folder)]


def refine(path: Path, finer: Path) -> None:
    """Write the mesh with each triangle cut into four until the file is ``MEAN_SIZE`` long."""
    mesh = open3d.io.read_triangle_mesh(path)
    finer.parent.mkdir(parents=True, exist_ok=True)
    while not finer.is_file() or finer.stat().st_size < MEAN_SIZE:
        mesh = mesh.subdivide_midpoint(1)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
        with finer.open("w", encoding="ascii") as file:
            file.write(f"OFF\n{len(vertices)} {len(faces)} 0\n")
            np.savetxt(file, vertices, "%.6f")
            np.savetxt(file, np.insert(faces, 0, 3, axis=1), "%d")


def real_meshes() -> Path:
    """Where real meshes of ModelNet40 would lie."""
    named = os.environ.get("PCRDIFF_REAL_DATA")
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return (Path(named) if named else beside) / "modelnet40_off"


def ours(items: Sequence[RawItem], out: Path) -> None:
    """Make a pair of each item with two workers, and write the pair file."""
    spread = spread_over(Compute(workers=WORKERS, scheduler=None), threads=1)
    third = len(items) // 3
    parts = (range(third), range(third, 2 * third), range(2 * third, len(items)))
    splits = {
        name: Streamed(len(part), make_pairs(items, part, NOISY, [7], spread=spread))
        for name, part in zip(("train", "val", "test"), parts, strict=True)
    }
    attributes = {"scenario": "noisy", "unit": "unit sphere", "seed": 7, "provenance": {}}
    write_pairs(out, splits, "category", attributes)


def loop(items: Sequence[RawItem], out: Path) -> None:
    """The same work as it is usually written: one file after the other, all of it in lists."""
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


def compare_speed(name: str, items: Sequence[RawItem], folder: Path, repeats: int) -> Comparison:
    """Both in turn, each time the whole way from files to a pair file."""
    calls = [partial(run, items, folder / "out.h5") for run in (ours, loop)]
    seconds = alternate(calls, repeats, warm_up=1)
    rates = [[len(items) / s for s in each] for each in seconds]
    return Comparison(name, rates[0], rates[1], "items/s", higher_is_better=True)


def compare_memory(items: Sequence[RawItem], folder: Path) -> Comparison:
    """How much more each needs for four times the items: the peak of a process of its own."""
    few, many = (list(items) * (n // len(items)) for n in NUMBER_OF_ITEMS)
    out = folder / "out.h5"
    grown = [_peak(run, many, out) - _peak(run, few, out) for run in (ours, loop)]
    own, theirs = (max(mib, 1.0) for mib in grown)  # below 1 MiB it is noise
    name = "preprocess_memory_growth_vs_loop"
    return Comparison(name, [own], [theirs], "MiB", higher_is_better=False)


def _peak(run: Run, items: Sequence[RawItem], out: Path) -> float:
    """The highest resident memory of a fresh process that runs it, in MiB."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_run_and_tell, run, list(items), out).result()


def _run_and_tell(run: Run, items: Sequence[RawItem], out: Path) -> float:
    run(items[:32], out)
    forget_peak()
    run(items, out)
    return resident("VmHWM")
