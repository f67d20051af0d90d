"""Peak memory of a registration against the size of the clouds: what grows, and how fast."""

import multiprocessing
import time
from collections.abc import Sequence
from functools import partial

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.geometry.rigid import transform
from pipeline.compute.machine import resident, settle
from pipeline.formats.benchmarks import PeakMemory
from pipeline.loading import build_learned, settings_of
from pipeline.settings.params import read_params

SEMI_AXES = (0.9, 0.6, 0.4)  # of the ellipsoid that is registered
MAX_ROTATION, MAX_TRANSLATION = np.pi / 4, 1.0  # the paper's


def measure_memory(method: str, points: Sequence[int], environment: str) -> list[PeakMemory]:
    """Register two clouds of each size, each in a fresh process, by an untrained network.

    The network is that of ``params.yaml`` in the current folder, in its last setting: the walk
    of ``diffusion``, or as many updates as its authors made.
    """
    with multiprocessing.get_context("spawn").Pool(1, maxtasksperchild=1) as pool:
        return pool.map(partial(register_once, method, environment), points, chunksize=1)


def register_once(method: str, environment: str, points: int) -> PeakMemory:
    """Register in this process, which should have done nothing before."""
    params = read_params()
    settle(params.threads, params.search_precision)
    torch.manual_seed(params.seed)
    setting = settings_of(method, params.methods)[-1]
    network = build_learned(method, setting, params.methods, params.diffusion).eval()
    source, target = make_clouds(points, params.seed)
    start = time.perf_counter()
    network.register(source, target, generator=torch.Generator().manual_seed(params.seed))
    seconds = time.perf_counter() - start
    return PeakMemory(method, points, resident("VmHWM"), seconds, environment)


def make_clouds(
    points: int, seed: int
) -> tuple[Float[Tensor, "1 points 3"], Float[Tensor, "1 points 3"]]:
    """Points on an ellipsoid, and the same points moved and in another order."""
    generator = np.random.default_rng(seed)
    directions = generator.normal(size=(1, points, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    source = torch.from_numpy(directions * SEMI_AXES)
    pose = draw_pose(PoseRange(MAX_ROTATION, MAX_TRANSLATION), generator=generator)
    target = transform(torch.from_numpy(pose)[None], source[:, generator.permutation(points)])
    return source.float(), target.float()
