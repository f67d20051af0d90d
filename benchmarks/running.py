"""The run: every part, one table on the screen, and the files at the end."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from benchmarks.effort import DRY, FULL, Effort
from benchmarks.inputs import needed_stages
from benchmarks.measuring import compare, describe_environment
from benchmarks.threads import every_processor
from pipeline.compute.machine import settle
from pipeline.compute.progress import bar
from pipeline.formats.benchmarks import Benchmarks, Ratio, write_benchmarks
from pipeline.settings.params import Params, read_params

FOLDER = Path("benchmarks")
THREADS = 1
"""Threads of every contender; see :mod:`benchmarks.threads`."""
PARTS = ("training", "registration", "memory", "preprocessing", "ceilings")
"""Steps of CF and CB, every method of the table, CB's memory, raw shapes to pairs, the machine."""
FIRST = (
    "cf_train_step_vs_plain",
    "cf_latency_vs_fastest_peer",
    "cf_throughput_vs_icp",
    "cb_latency_vs_rpmnet",
    "preprocess_vs_loop",
)
"""The ratios that are promised, in the order in which they are shown."""


def main(argv: Sequence[str] | None = None) -> None:
    """Measure and write; a part alone, or a dry run, is shown and not written."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=PARTS, help="measure one part and write nothing")
    parser.add_argument("--dry", action="store_true", help="tiny sizes; write nothing")
    parser.add_argument("--stages", action="store_true", help="list the stages needed before")
    args = parser.parse_args(argv)

    params = read_params()
    if args.stages:
        say(needed_stages(params))
        return
    settle(THREADS, params.search_precision)
    parts = PARTS if args.only is None else [args.only]
    found = measure(params, parts, DRY if args.dry else FULL)
    say(lines(found))
    if not args.dry and args.only is None:
        write_benchmarks(FOLDER, found)


def measure(params: Params, parts: Sequence[str], effort: Effort) -> Benchmarks:
    """Measure the parts one after the other; the promised ratios come first."""
    environment = describe_environment()
    found = [measure_part(part, params, effort, environment) for part in bar(parts, "benchmarks")]
    return Benchmarks(
        ratios=sorted((row for one in found for row in one.ratios), key=rank),
        latencies=[row for one in found for row in one.latencies],
        memory=[row for one in found for row in one.memory],
        ceilings=[row for one in found for row in one.ceilings],
    )


def rank(ratio: Ratio) -> tuple[int, str]:
    """Sort key: what is promised, then the rest by name."""
    return (FIRST.index(ratio.name) if ratio.name in FIRST else len(FIRST), ratio.name)


def measure_part(part: str, params: Params, effort: Effort, environment: str) -> Benchmarks:
    """Measure one of ``PARTS``; what another part needs is not loaded."""
    if part == "training":
        from benchmarks.training import measure_training

        steps = measure_training(params, effort)
        return Benchmarks(ratios=[compare(each, environment) for each in steps])
    if part == "registration":
        from benchmarks.registration import compare_registrations, measure_registration

        contenders = measure_registration(params, effort)
        return Benchmarks(
            ratios=[compare(each, environment) for each in compare_registrations(contenders)],
            latencies=[each.row(environment) for each in contenders],
        )
    if part == "memory":
        from benchmarks.memory import measure_memory

        found = measure_memory("pcrdiffusion_cb", effort.memory_points, environment)
        return Benchmarks(memory=found)
    if part == "preprocessing":
        from benchmarks.preprocessing import WORKERS, measure_preprocessing

        with every_processor():
            pairs = measure_preprocessing(effort.rounds)
        where = f"{environment}; {WORKERS} workers"
        return Benchmarks(ratios=[compare(each, where) for each in pairs])
    from benchmarks.ceilings import measure_ceilings

    return Benchmarks(ceilings=measure_ceilings(effort, environment))


def lines(found: Benchmarks) -> Iterator[str]:
    """What was found, for a screen: ratios first."""
    for row in found.ratios:
        yield (
            f"{row.name:48} {row.ratio:8.2f} x  (spread {row.spread:.2f}, n {row.n}; "
            f"ours {row.ours:.4g}, peer {row.peer:.4g} {row.unit})"
        )
    for each in found.latencies:
        yield (
            f"{each.method:16} {each.setting:9} {each.points:5} points {each.latency_ms:9.2f} ms"
            f" {each.pairs_per_s:8.1f} pairs/s  {each.error_r_deg:7.2f} deg"
            f"  ({each.n} pairs, {each.batch} at once, {each.failures} failures)"
        )
    for one in found.memory:
        yield f"{one.method:16} {one.points:6} points {one.peak_mib:8.0f} MiB {one.seconds:7.2f} s"
    for loop in found.ceilings:
        yield (
            f"{loop.name:36} {loop.ms:9.3f} ms  {loop.gflop_per_s:8.1f} GFLOP/s"
            f" ({100 * loop.gflop_share:5.1f} %)  {loop.gbyte_per_s:6.2f} GB/s"
            f" ({100 * loop.gbyte_share:5.1f} %)"
        )


def say(texts: Iterable[str]) -> None:
    """Write lines to the screen."""
    for text in texts:
        sys.stdout.write(f"{text}\n")
