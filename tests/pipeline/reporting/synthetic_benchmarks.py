"""A synthetic run of `make bench`."""

from pipeline.formats.benchmarks import Benchmarks, Ceiling, Latency, PeakMemory, Ratio
from pipeline.reporting.paper import METHODS

HERE = "Some Processor 9; 2 cores; 1 thread; torch 2.13.0; float32 search"


def make_benchmarks() -> Benchmarks:
    """Everything, every method once and CF a second time on a part of the points."""
    return Benchmarks(
        ratios=[
            Ratio("cf_train_step_vs_plain", 6.5, 3.25, 0.5, "steps/s", 15, 0.25, HERE),
            Ratio("cb_latency_vs_rpmnet", 4.0, 100.0, 400.0, "ms", 18, 0.5, HERE),
        ],
        latencies=[
            *(_latency(method, 2048, 2.0 * 1.5**k) for k, method in enumerate(METHODS)),
            _latency("pcrdiffusion_cf", 512, 1.25),
        ],
        memory=[
            PeakMemory("pcrdiffusion_cb", n, 300.0 + n / 16, n / 512, HERE)
            for n in (512, 2048, 16384)
        ],
        ceilings=[
            Ceiling("large float32 product", "machine", 10.0, 0.5, 15, 100.0, 1.0, 5.0, 0.5, HERE),
            Ceiling("copy", "machine", 2.0, 0.25, 15, 0.0, 0.0, 10.0, 1.0, HERE),
            Ceiling("PointNet, inference", "loop", 4.0, 0.25, 15, 60.0, 0.6, 1.0, 0.1, HERE),
            Ceiling("Sinkhorn", "loop", 8.0, 0.5, 15, 5.0, 0.05, 7.5, 0.75, HERE),
        ],
    )


def _latency(method: str, points: int, ms: float) -> Latency:
    numbers = float(f"{ms:.5g}"), float(f"{ms / 10:.5g}"), 64, float(f"{1500 / ms:.5g}"), 64
    return Latency(method, "paper", points, *numbers, 2.5, 0.03125, 1, HERE)
