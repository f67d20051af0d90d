"""(iii) Peak memory of a CB registration, each size in a process of its own."""

import json
import subprocess
import sys
import time
from collections.abc import Sequence

SIZES = (512, 1024, 2048, 4096, 8192, 16384)


def measure_memory(sizes: Sequence[int] = SIZES) -> list[tuple[int, float, float]]:
    """Points of each cloud, peak resident memory of the process in MiB, seconds.

    Raises:
        RuntimeError: A process ended without an answer.
    """
    return [_in_fresh_process(size) for size in sizes]


def _in_fresh_process(points: int) -> tuple[int, float, float]:
    command = [sys.executable, "-m", "benchmarks.memory", str(points)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=False, text=True)
    if done.returncode:
        raise RuntimeError(f"CB at {points} points ended with exit code {done.returncode}")
    peak, seconds = json.loads(done.stdout)
    return points, float(peak), float(seconds)


def _measure_here(points: int) -> tuple[float, float]:
    """Peak memory in MiB and seconds of the first registration in this process."""
    import torch

    from pipeline.building import build_learned
    from pipeline.machine import settle
    from pipeline.params import read_params
    from pipeline.timing import forget_peak, resident

    params = read_params()
    settle(params.threads)
    generator = torch.Generator().manual_seed(0)
    method = build_learned("pcrdiffusion_cb", "paper", params.methods, params.diffusion)
    cloud = torch.rand(1, points, 3, generator=generator)
    forget_peak()
    start = time.perf_counter()
    method.register(cloud, cloud + 0.1, generator=generator)
    return resident("VmHWM"), time.perf_counter() - start


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_measure_here(int(sys.argv[1]))))
