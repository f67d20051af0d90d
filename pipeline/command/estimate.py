"""What the trainings of a profile will cost: a few steps of each, timed before any of them begins."""

import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from math import ceil
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import torch

from pcrdiff.datasets.families import READERS
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.pairs.scenarios import Split, split_items
from pcrdiff.registration import Pairs
from pcrdiff.training.budget import Budget
from pcrdiff.training.loop import Trainer
from pipeline.compute.machine import settle
from pipeline.loading import build_untrained
from pipeline.settings.params import Params, Scenario
from pipeline.settings.variants import TRAINED, variants

SECONDS = 1.0
"""For which the steps of one network are timed, after a first one; a slow step is timed once."""
ENDLESS = 10**9
"""Epochs of a budget that is never at a validation."""


@dataclass(frozen=True)
class Estimate:
    """What one training, or all variants of one method, will cost."""

    method: str
    scenario: str
    epochs: int
    steps: int
    seconds: float
    """Of processor time per step, on this machine and in the threads of params.yaml."""

    @property
    def hours(self) -> float:
        """Of one core."""
        return self.steps * self.seconds / 3600


def estimate(params: Params, root: Path) -> Iterator[Estimate]:
    """Estimate each training; the variants of an ablation as if they were the method as it is.

    The steps are taken in a process of its own, since one that has settled keeps its memory.

    Args:
        params: The params of the profile.
        root: The project.

    Raises:
        FileNotFoundError, ValueError: A data set is not there or not what it should be.
    """
    settled = (params.threads, params.search_precision)
    with ProcessPoolExecutor(1, get_context("spawn"), settle, settled) as child:
        yield from _estimates(params, root, child)


def _estimates(params: Params, root: Path, child: Executor) -> Iterator[Estimate]:
    counts = {name: training_pairs(params, name, root) for name in params.run.scenarios}
    timed: dict[tuple[str, int], float] = {}

    def cost(method: str, scenario: str, epochs: int, what: str) -> Estimate:
        points = params.scenarios[scenario].num_points
        if (method, points) not in timed:
            asked = child.submit(_timed, params.model_dump(), method, scenario)
            timed[method, points] = asked.result()
        given = getattr(params.train, method)
        pairs = min(given.epoch_pairs or counts[scenario], counts[scenario])
        steps = epochs * ceil(pairs / given.batch_size)
        return Estimate(method, what, epochs, steps, timed[method, points])

    for method in (*params.run.diffused, *params.run.baselines):
        for scenario, training in params.trainings[method].items():
            yield cost(method, scenario, training.epochs, scenario)
    scenario = params.ablation.scenario
    for method, times in _ablated(params).items():
        yield cost(
            method,
            scenario,
            times * params.ablation.epochs[method],
            f"{scenario}, {times} variants",
        )


def training_pairs(params: Params, scenario: str, root: Path) -> int:
    """Count the training pairs of a scenario, of which there may be no pair file yet.

    Raises:
        FileNotFoundError, ValueError: The data set is not there or not what it should be.
    """
    made = params.scenarios[scenario]
    if made.pairs.train is not None:
        return made.pairs.train
    acquire = params.acquire[made.dataset]
    items = READERS[acquire.family](Path(root, acquire.root or f"data/raw/{made.dataset}"))
    return len(split_items(items, Split(**made.split.model_dump()))["train"])


def step_seconds(params: Params, method: str, scenario: Scenario) -> float:
    """Processor time of a method's training step on random clouds of a scenario's number of points."""
    given = getattr(params.train, method)
    pairs = _random_pairs(given.batch_size, scenario)
    often = given.model_dump() | {"validate_every": ENDLESS, "epoch_pairs": None}
    poses = PoseRange(scenario.max_rotation, scenario.max_translation, scenario.min_translation)
    network = build_untrained(method, params.methods, params.diffusion)
    trainer = Trainer(network, pairs, pairs, Budget(ENDLESS, **often), poses, seed=0)
    network.prepare(pairs)
    network.train()
    trainer.run_epoch(0)  # of one batch; the first step also allocates
    started, steps = time.process_time(), 0  # which does not see what else the machine does
    while steps == 0 or time.process_time() - started < SECONDS:
        steps += 1
        trainer.run_epoch(steps)
    return (time.process_time() - started) / steps


def told(estimates: Iterable[Estimate]) -> Iterator[str]:
    """Say it as a table, line by line as it becomes known, with the total."""
    head = f"{'epochs':>6} {'steps':>7} {'s/step':>7} {'core-hours':>10}"
    yield f"{'training':22} {'on':40} {head}"
    total = 0.0
    for one in estimates:
        total += one.hours
        numbers = f"{one.epochs:6} {one.steps:7} {one.seconds:7.3f} {one.hours:10.2f}"
        yield f"{one.method:22} {one.scenario:40} {numbers}"
    yield f"{'all':22} {'':40} {'':22} {total:10.2f}"


def _timed(values: dict[str, Any], method: str, scenario: str) -> float:
    """Time a step in the child, which is sent plain values: sections cannot be pickled."""
    params = Params.model_validate(values)
    return step_seconds(params, method, params.scenarios[scenario])


def _ablated(params: Params) -> dict[str, int]:
    """How many variants of each method are trained."""
    trained = [
        method
        for name in TRAINED
        for value in getattr(params.ablation, f"{name}s")
        for method, _ in variants(params, name, value)
    ]
    return {method: trained.count(method) for method in dict.fromkeys(trained)}


def _random_pairs(count: int, scenario: Scenario) -> Pairs:
    """Pairs of a cloud in the unit sphere and the same cloud with jitter, not yet moved."""
    generator = torch.Generator().manual_seed(0)
    normals = torch.randn(count, scenario.num_points, 3, generator=generator)
    normals /= normals.norm(dim=-1, keepdim=True)
    source = normals * torch.rand(count, scenario.num_points, 1, generator=generator)
    jitter = 0.01 * torch.randn(source.shape, generator=generator)
    both = {"source": source, "target": source + jitter}
    if scenario.normals == "given":
        both |= {"source_normals": normals, "target_normals": normals}
    return Pairs(
        **both,
        T_target_source=torch.eye(4, dtype=torch.float64).repeat(count, 1, 1),
        item=torch.arange(count),
        group=("random",) * count,
    )
