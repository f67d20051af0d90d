"""(iv) Preprocessing, items a second, beside a straight loop over Open3D and NumPy."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.inputs import make_pairs
from benchmarks.measuring import Comparison, alternate
from pcrdiff.data.native import open3d
from pipeline.params import read_params

POINTS, ITEMS = 2048, 24


def measure_preprocessing(repeats: int) -> Comparison:
    """Test shapes to pairs with jitter; ours makes as many for training, and one to choose by."""
    params = read_params()
    files = sorted(Path("data/raw/modelnet40").glob("*/test/*.off"))[:ITEMS]
    calls = [lambda: make_pairs(params, POINTS, ITEMS), lambda: straight_loop(files)]
    ours, loop = alternate(calls, repeats, warm_up=1)
    return Comparison(
        "preprocess_vs_loop",
        [(2 * ITEMS + 1) / seconds for seconds in ours],
        [len(files) / seconds for seconds in loop],
        "items/s",
        higher_is_better=True,
    )


def straight_loop(files: Sequence[Path]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sources and targets, one file after the other."""
    random = np.random.default_rng(0)
    sources: list[NDArray[np.float64]] = []
    targets: list[NDArray[np.float64]] = []
    for file in files:
        mesh = open3d.io.read_triangle_mesh(file)
        source = np.asarray(mesh.sample_points_uniformly(POINTS).points)
        source = source - source.mean(axis=0)
        source = source / np.linalg.norm(source, axis=1).max()
        R = Rotation.from_euler("xyz", random.uniform(0, 45, 3), degrees=True).as_matrix()
        target = source @ R.T + random.uniform(0, 1, 3)
        for cloud, kept in ((source, sources), (target, targets)):
            noisy = cloud + np.clip(random.normal(0, 0.01, cloud.shape), -0.05, 0.05)
            kept.append(random.permutation(noisy))
    return np.stack(sources), np.stack(targets)
