"""Trains a few methods, here and now or in two processes, and writes what came of it.

``python -m tests.pipeline.compute.training_together FOLDER`` starts its second process by itself.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.methods.fmr import FMR
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.methods.pcrnet import PCRNet
from pcrdiff.models.pose_encoder import Diffusion
from pcrdiff.registration import LearnedMethod
from pcrdiff.training.budget import Budget, Epoch
from pcrdiff.training.loop import Trainer, train
from pcrdiff.training.ranks import Processes
from pipeline.compute.ranks import join
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs

GLOBAL_BATCH = 6
PAIRS = 13  # batches of six, six and one, of which the second process has nothing
EPOCHS = 4
NAMES = ("cf", "cf-without", "pcrnet", "fmr")
RESUMED = "resumed"
T = TypeVar("T")


@dataclass(frozen=True)
class Outcome:
    """What a training came to."""

    curve: list[Epoch]
    best_epoch: int
    best: dict[str, Tensor]
    weights: dict[str, Tensor]
    """Of the last epoch."""


def make_method(name: str) -> LearnedMethod:
    """A small one of the method."""
    if name == "pcrnet":
        return PCRNet(feature_dim=16, train_updates=2, probes=8, updates=2)
    if name == "fmr":  # its decoder has no part in the pose, nor in what is validated
        return FMR(feature_dim=16, decoded_points=16, difference=0.1, train_updates=2, updates=2)
    told: Diffusion = "without" if name == "cf-without" else "with"
    return PCRDiffusionCF(Walk(20, 1, "ddpm"), 16, "quaternion", "raw", "source", told)


class Memory:
    """A checkpoint of the first process; the training ends after some epochs as if killed."""

    def __init__(self, processes: Processes, killed_after: int | None = None) -> None:
        self.kept: tuple[dict[str, Tensor], dict[str, object]] | None = None
        self.first, self.killed_after = processes.rank == 0, killed_after

    def due(self) -> bool:
        """In the first process alone."""
        return self.first

    def load(self) -> tuple[dict[str, Tensor], dict[str, object]] | None:
        """What was saved last."""
        return self.kept

    def save(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """As a file would."""
        self.kept = {name: value.clone() for name, value in tensors.items()}, dict(record)

    def watched(self, items: Sequence[T], description: str) -> Iterable[T]:
        """The epochs until the kill."""
        del description
        return items[: self.killed_after]


def outcome(name: str, processes: Processes, memory: Memory) -> Outcome:
    """Train to the end, or until the kill."""
    torch.manual_seed(processes.rank)  # others than the first start from its weights all the same
    budget = Budget(EPOCHS, GLOBAL_BATCH // processes.count, 0.001, "cosine", 1, 2)
    pairs = synthetic_pairs(PAIRS, 24, generator=seeded(0))
    val = synthetic_pairs(5, 24, generator=seeded(1))
    trainer = Trainer(
        make_method(name), pairs, val, budget, PoseRange(0.5, 0.5), seed=3, processes=processes
    )
    best, curve = train(trainer, memory, memory.watched)
    return Outcome(curve, trainer.state.best_epoch, best, trainer.method.state_dict())


def main() -> None:
    """Train each method in two processes, and one of them once more with a break."""
    folder = Path(sys.argv[1])
    with join(2, 1) as processes:
        torch.set_num_threads(1)
        for name in NAMES:
            whole = outcome(name, processes, Memory(processes))
            torch.save(vars(whole), folder / f"{name}-{processes.rank}.pt")
        memory = Memory(processes, killed_after=3)
        outcome(NAMES[0], processes, memory)
        memory.killed_after = None
        resumed = outcome(NAMES[0], processes, memory)
        torch.save(vars(resumed), folder / f"{RESUMED}-{processes.rank}.pt")


if __name__ == "__main__":
    main()
