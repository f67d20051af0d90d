"""DVC stages ``train``, ``train_baselines`` and ``train_{diffusion,representation,fusion}``.

From pairs to weights: of PCRDiffusion on one scenario, of another learned method on each of its
scenarios, or of the variants that Tables 3 to 5 compare.
"""

import argparse
import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from pcrdiff.geometry.precision import resolve, search_precision
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.loops import silent
from pcrdiff.training.budget import Budget, Epoch
from pcrdiff.training.loop import Trainer, train
from pcrdiff.training.ranks import ALONE, Processes
from pcrdiff.training.state import Checkpoint
from pipeline.compute.checkpoints import NoCheckpoint, open_checkpoint
from pipeline.compute.machine import settle
from pipeline.compute.progress import bar
from pipeline.compute.ranks import check_agreement, join
from pipeline.formats.files import write_json
from pipeline.formats.pairs import read_attributes, read_pairs
from pipeline.formats.weights import (
    CURVE,
    FACTS,
    WEIGHTS,
    shipped_weights,
    write_curve,
    write_weights,
)
from pipeline.loading import build_untrained, take_weights
from pipeline.settings.params import DIFFUSED, Params, pick, read_params
from pipeline.settings.seeding import stream
from pipeline.settings.variants import TRAINED, Variant, folder_of, settings_trained, variants
from pipeline.tracking.journal import Journal, content_md5, journal


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train, write the best weights, the curve and what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--method")
    what.add_argument("--ablation", choices=sorted(TRAINED))
    parser.add_argument("--scenario", help="of the method; all that it is trained on by default")
    parser.add_argument("--value", help="of what the ablation varies")
    parser.add_argument(
        "--pairs", type=Path, required=True, help="pair file; of several, the folder"
    )
    parser.add_argument(
        "--models", type=Path, required=True, help="folder of the training or trainings"
    )
    args = parser.parse_args(argv)
    if args.ablation and not args.value:
        parser.error("--ablation needs --value, one of what it varies")

    params = read_params()
    if args.ablation:
        trainings = ablation_trainings(params, args.ablation, args.value, args.pairs, args.models)
    elif args.scenario:
        trainings = [Training(args.scenario, args.method, args.pairs, args.models)]
    else:
        trainings = [
            Training(name, args.method, args.pairs / f"{name}.h5", args.models / name)
            for name in pick(params.trainings, args.method, "trainings")
        ]
    train_all(params, trainings)


CODE = (
    Path("pcrdiff"),
    Path("pipeline/loading.py"),
    Path("pipeline/compute/ranks.py"),
    Path("stages/train.py"),
)
"""What a half-done training was made with: if it changes, the training starts again."""

VALIDATION_WALK = {"steps": 1, "sampler": "ddpm", "hypotheses": 1}
"""How validation samples: fixed, so that evaluation settings cannot influence model selection."""


@dataclass(frozen=True)
class Training:
    """What is trained on what, one of the trainings of a stage."""

    scenario: str
    method: str
    pairs: Path
    folder: Path
    """Where its files go."""
    variant: Variant = field(default_factory=dict)
    """What differs from the method as params.yaml has it; nothing for a main training."""


def ablation_trainings(
    params: Params, ablation: str, value: str, pairs: Path, models: Path
) -> list[Training]:
    """The trainings of an ablation with one value of what it varies."""
    return [
        Training(
            params.ablation.scenario,
            method,
            pairs,
            models / folder_of(params, ablation, method, variant).name,
            variant,
        )
        for method, variant in variants(params, ablation, value)
    ]


@dataclass(frozen=True)
class Trained:
    """The outcome of a training."""

    weights: dict[str, Tensor]
    """Weights of the epoch with the lowest validation error."""
    curve: list[Epoch]
    facts: dict[str, object]
    """How much training this was."""

    def write(self, folder: Path) -> None:
        """Write the weights, the curve and the facts."""
        write_weights(folder / WEIGHTS, self.weights, self.facts)
        write_curve(folder / CURVE, self.curve)
        write_json(folder / FACTS, self.facts)

    def note_curve(self, notes: Journal) -> None:
        """Put the curve into the journal."""
        for epoch in self.curve:
            values = {"loss": epoch.losses["loss"]}
            if epoch.val_error_r_deg is not None:
                values["val_error_r_deg"] = epoch.val_error_r_deg
            notes.metrics(values, step=epoch.epoch)


def train_all(params: Params, trainings: Sequence[Training]) -> None:
    """Train each to the end of its budget, and write its files as soon as it is done.

    Of several processes the first writes; the others train along. When the stage is killed, the
    states of all its trainings are kept, and it continues from them.

    Raises:
        FileNotFoundError, ValueError: A pair file is missing or is not one, as are the weights that a
            training starts from, or the processes disagree.
        RuntimeError: A gradient is not finite.
    """
    described = [training_params(params, training) for training in trainings]
    pairs = sorted({training.pairs for training in trainings})
    with join(params.train.devices, params.train.nodes) as processes:
        settle(params.threads, params.search_precision)
        check_agreement(processes, {"trainings": described}, [*pairs, *CODE])
        if processes.rank > 0:
            for training in trainings:
                train_method(params, training, NoCheckpoint(), processes)
            return
        with (
            journal(params=_noted(described), inputs=pairs) as notes,
            ExitStack() as until_all_are_done,
        ):
            for training, its_params in zip(trainings, described, strict=True):
                checkpoint = until_all_are_done.enter_context(
                    open_checkpoint(its_params, [training.pairs, *CODE])
                )
                outcome = train_method(params, training, checkpoint, processes)
                outcome.write(training.folder)
                if len(trainings) == 1:
                    outcome.note_curve(notes)


NOTED = ("search_precision", "method", "scenario", "epochs", "batch_size", "learning_rate")
"""What MLflow shows of a training's params; all of them are in ``dvc.lock``."""


def _noted(described: Sequence[dict[str, Any]]) -> dict[str, object]:
    """What the trainings of a stage have in common, and what they do not, as text."""
    different = {name: [str(each[name]) for each in described] for name in NOTED}
    return {name: ", ".join(dict.fromkeys(values)) for name, values in different.items()}


def epochs_of(params: Params, training: Training) -> int:
    """The budget of a training; a variant's is the ablation's own, the same for all of a method."""
    if training.variant:
        return pick(params.ablation.epochs, training.method, "ablation.epochs")
    return params.training(training.scenario, training.method).epochs


def start_of(params: Params, training: Training) -> Path | None:
    """The shipped weights that a training starts from; None where it starts from fresh ones.

    Raises:
        FileNotFoundError: No such weights are shipped.
    """
    if training.variant:
        return None
    start = params.training(training.scenario, training.method).start
    if start is None:
        return None
    weights = shipped_weights(training.method, start)
    if not weights.is_file():
        key = f"trainings.{training.method}.{training.scenario}.start"
        raise FileNotFoundError(f"{key} {start!r} needs weights at {weights}, there are none")
    return weights


def _start(params: Params, training: Training) -> dict[str, str]:
    """What is told of the start of a training, which ``dvc.lock`` does not hold; of most nothing."""
    weights = start_of(params, training)
    return {"start": weights.stem, "start_md5": content_md5(weights)} if weights else {}


def training_params(params: Params, training: Training) -> dict[str, Any]:
    """All of params.yaml that a training depends on, besides its pairs."""
    method = training.method
    return {
        "seed": params.seed,
        "threads": params.threads,
        "search_precision": resolve(params.search_precision),
        "devices": params.train.devices,
        "nodes": params.train.nodes,
        "scenario": training.scenario,
        "method": method,
        "epochs": epochs_of(params, training),
        "poses": params.train.poses,
        **_process(params, method),
        "network": {**getattr(params.methods, method).network.model_dump(), **training.variant},
        **_start(params, training),
        **getattr(params.train, method).model_dump(),
    }


def train_method(
    params: Params, training: Training, checkpoint: Checkpoint, processes: Processes = ALONE
) -> Trained:
    """Train a method, or a variant of it, to the end of its budget.

    All variants of a method start from the same draws and see the pairs in the same order. Each of
    several processes comes back with the same outcome.

    Raises:
        FileNotFoundError, ValueError: The pair file is missing or is not one, or the weights to start
            from are missing or those of another network.
        RuntimeError: A gradient is not finite.
    """
    scenario, method = training.scenario, training.method
    torch.manual_seed(stream(params.seed, f"init/{scenario}/{method}"))
    walk = params.diffusion.model_copy(update=VALIDATION_WALK)
    network = build_untrained(method, params.methods, walk, training.variant)
    if start := start_of(params, training):
        take_weights(network, start)
    data, val = read_pairs(training.pairs, "train"), read_pairs(training.pairs, "val")
    budget = Budget(epochs_of(params, training), **getattr(params.train, method).model_dump())
    trainer = Trainer(
        network,
        data,
        val,
        budget,
        fresh_poses(training.pairs) if params.train.poses == "fresh" else None,
        seed=stream(params.seed, f"train/{scenario}/{method}"),
        processes=processes,
    )
    weights, curve = train(trainer, checkpoint, bar if processes.rank == 0 else silent)
    facts = facts_of(params, training, trainer, len(data))
    return Trained(weights, curve, facts)


def facts_of(
    params: Params, training: Training, trainer: Trainer, train_pairs: int
) -> dict[str, object]:
    """How much training this was, for the report and for whoever is given the weights."""
    budget, state = trainer.budget, trainer.state
    facts: dict[str, object] = {
        "method": training.method,
        "scenario": training.scenario,
        "epochs": budget.epochs,
        "steps": state.curve[-1].step,
        "batch_size": budget.batch_size,
        "devices": params.train.devices,
        "nodes": params.train.nodes,
        "threads": params.threads,
        "search_precision": search_precision(),
        "data": _origin(training.pairs),
        "train_pairs": train_pairs,
        "epoch_pairs": trainer.pairs_per_epoch,
        "network": training_params(params, training)["network"],
        "parameters": sum(p.numel() for p in trainer.method.parameters()),
        "best_epoch": state.best_epoch,
        "val_error_r_deg": state.best_error if math.isfinite(state.best_error) else None,
        "poses": params.train.poses,
        **_process(params, training.method),
        **({} if budget.points is None else {"step_points": budget.points}),
        **_start(params, training),
    }
    if training.variant:
        facts["settings"] = settings_trained(params, training.method, training.variant)
    return facts


def _origin(pairs: Path) -> dict[str, object]:
    """Of which data set the pairs are, where it came from, under which licence, and how large."""
    made = read_attributes(pairs)["provenance"]
    told = {key: made.get(key) for key in ("dataset", "source", "licence")}
    return told | {"points": made["scenario"]["num_points"]}


def _process(params: Params, method: str) -> dict[str, int]:
    """What a training knows of the diffusion process, if its method has one."""
    return {"timesteps": params.diffusion.timesteps} if method in DIFFUSED else {}


def fresh_poses(pairs: Path) -> PoseRange:
    """New poses within the bounds that the pair file says its own were drawn within."""
    made = read_attributes(pairs)["provenance"]["scenario"]
    degrees, low, high = (
        made[key] for key in ("max_rotation_deg", "min_translation", "max_translation")
    )
    return PoseRange(None if degrees is None else math.radians(degrees), high, low)
