"""Training one method on one scenario as params.yaml says, and what there is to tell of it."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from pcrdiff.geometry.precision import resolve, search_precision
from pcrdiff.processes import ALONE, Processes
from pcrdiff.progress import silent
from pcrdiff.training import Budget, Checkpoint, Epoch, FreshPoses, Trainer, train
from pipeline.artifacts import read_pairs
from pipeline.building import build_untrained
from pipeline.params import Params, pick
from pipeline.progress import bar
from pipeline.seeding import stream
from pipeline.tracking import Journal
from pipeline.variants import AS_IT_IS, Variant, setting_of

CODE = (
    Path("pcrdiff"),
    Path("pipeline/building.py"),
    Path("pipeline/processes.py"),
    Path("pipeline/training.py"),
)
"""What a half-done training was made with: if it changes, the training starts anew."""

VALIDATION_WALK = {"steps": 1, "sampler": "ddpm", "hypotheses": 1}
"""How validation samples, whatever evaluation does: other steps must not choose other weights."""


@dataclass(frozen=True)
class Trained:
    """The outcome of a training."""

    weights: dict[str, Tensor]
    """Of the epoch that did best on the validation pairs."""
    curve: list[Epoch]
    facts: dict[str, object]
    """How much training this was."""

    def note(self, notes: Journal) -> None:
        """Put the curve and the facts into the journal."""
        for epoch in self.curve:
            values = {f"train_{name}": value for name, value in epoch.losses.items()}
            values["learning_rate"] = epoch.learning_rate
            if epoch.val_error_r_deg is not None and epoch.val_error_t is not None:
                values["val_error_r_deg"] = epoch.val_error_r_deg
                values["val_error_t"] = epoch.val_error_t
            notes.metrics(values, step=epoch.epoch)
        notes.metrics({name: v for name, v in self.facts.items() if isinstance(v, int | float)})


def epochs_of(params: Params, scenario: str, method: str, variant: Variant) -> int:
    """The budget of a training; a variant's is the ablation's own, the same for all of a method."""
    if variant:
        return pick(params.ablation.epochs, method, "ablation.epochs")
    return params.training(scenario, method).epochs


def training_params(
    params: Params, scenario: str, method: str, variant: Variant = AS_IT_IS
) -> dict[str, Any]:
    """All of params.yaml that a training depends on."""
    return {
        "seed": params.seed,
        "threads": params.threads,
        "search_precision": resolve(params.search_precision),
        "devices": params.train.devices,
        "nodes": params.train.nodes,
        "scenario": scenario,
        "method": method,
        "epochs": epochs_of(params, scenario, method, variant),
        "poses": params.train.poses,
        "max_rotation_deg": params.scenarios[scenario].max_rotation_deg,
        "max_translation": params.scenarios[scenario].max_translation,
        "timesteps": params.diffusion.timesteps,
        "network": {**getattr(params.methods, method).network.model_dump(), **variant},
        **getattr(params.train, method).model_dump(),
    }


def train_method(  # noqa: PLR0913 - what stages/train.py is told, where it goes on, and with whom
    params: Params,
    scenario: str,
    method: str,
    variant: Variant,
    pairs: Path,
    checkpoint: Checkpoint,
    processes: Processes = ALONE,
) -> Trained:
    """Train a method, or a variant of it, to the end of its budget.

    All variants of a method start from the same draws and see the pairs in the same order. Each of
    several processes comes back with the same outcome.

    Raises:
        FileNotFoundError, ValueError: The pair file is not there or not one.
        RuntimeError: A gradient is not finite.
    """
    torch.manual_seed(stream(params.seed, f"init/{scenario}/{method}"))
    walk = params.diffusion.model_copy(update=VALIDATION_WALK)
    network = build_untrained(method, params.methods, walk, variant)
    data, val = read_pairs(pairs, "train"), read_pairs(pairs, "val")
    settings = getattr(params.train, method)
    budget = Budget(epochs_of(params, scenario, method, variant), **settings.model_dump())
    made = params.scenarios[scenario]
    fresh = FreshPoses(made.max_rotation, made.max_translation)
    trainer = Trainer(
        network,
        data,
        val,
        budget,
        fresh if params.train.poses == "fresh" else None,
        seed=stream(params.seed, f"train/{scenario}/{method}"),
        processes=processes,
    )
    weights, curve = train(trainer, checkpoint, bar if processes.rank == 0 else silent)
    facts: dict[str, object] = {
        "method": method,
        "scenario": scenario,
        "epochs": budget.epochs,
        "steps": curve[-1].step,
        "batch_size": budget.batch_size,
        "devices": params.train.devices,
        "nodes": params.train.nodes,
        "threads": params.threads,
        "search_precision": search_precision(),
        "train_pairs": len(data),
        "epoch_pairs": trainer.pairs_per_epoch,
        "parameters": sum(p.numel() for p in network.parameters()),
        "best_epoch": trainer.best_epoch,
        "val_error_r_deg": _or_none(trainer.best_error),
        "poses": params.train.poses,
        "timesteps": params.diffusion.timesteps,
    }
    if variant:
        facts["setting"] = setting_of(variant)
    return Trained(weights, curve, facts)


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
