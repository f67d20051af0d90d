"""A synthetic page with everything on it: findings, walks, studies and every method."""

from dataclasses import replace
from pathlib import Path

from pipeline.formats.benchmarks import write_benchmarks
from pipeline.reporting.claims import Finding
from pipeline.reporting.page import Contents
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.report import make_contents as make_the_contents
from tests.pipeline.reporting.synthetic_benchmarks import make_benchmarks
from tests.pipeline.reporting.synthetic_results import (
    EVERY_METHOD,
    SCENARIOS,
    write_everything,
    write_starts,
    write_verified,
)

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
    """Write synthetic inputs under ``folder`` and read them as the report does."""
    write_everything(folder, scenarios, pairs, EVERY_METHOD)
    write_starts(folder / "results", scenarios[:2], pairs)
    for scenario in scenarios:
        write_verified(folder / "results", scenario, pairs)
    write_benchmarks(folder / "benchmarks", make_benchmarks())
    parts = (folder / name for name in ("results", "models", "pairs", "benchmarks"))
    contents = make_the_contents(*parts, profile="quick", provenance=PROVENANCE)
    return replace(contents, findings=FINDINGS)
