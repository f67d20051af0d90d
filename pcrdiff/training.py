"""One loop for every learned method: step, validate, keep the best."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import torch
from torch import Tensor

from pcrdiff.data.corruption import draw_pose
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.metrics import error_r_deg, error_t
from pcrdiff.progress import Progress, silent
from pcrdiff.registration import LearnedMethod, Pairs

WARM_UP, FLOOR = 0.05, 0.02  # share of a cosine schedule spent rising, and where it ends


@dataclass(frozen=True)
class Budget:
    """How long and how to train."""

    epochs: int
    batch_size: int
    learning_rate: float
    schedule: Literal["plateau", "cosine"]
    """Halve when an epoch's loss has stopped falling (the paper's), or fall along a cosine."""
    patience: int
    """Epochs without a better loss before the plateau schedule halves."""
    validate_every: int
    """Epochs between looks at the validation pairs; the last epoch is always looked at."""
    epoch_pairs: int | None = None
    """Training pairs in an epoch, drawn anew for each; None takes all of them."""


@dataclass(frozen=True)
class FreshPoses:
    """The range that a new training pose is drawn from each epoch; angles in radians."""

    max_rotation: float
    max_translation: float


@dataclass(frozen=True)
class Epoch:
    """One row of the training curve."""

    epoch: int
    step: int
    learning_rate: float
    losses: Mapping[str, float]
    """Each term and their sum, ``loss``; means over the epoch."""
    val_error_r_deg: float | None
    val_error_t: float | None


@runtime_checkable
class Checkpoint(Protocol):
    """Where a killed training is picked up again."""

    def load(self) -> tuple[dict[str, Tensor], dict[str, object]] | None:
        """What was saved last, or nothing."""
        ...

    def due(self) -> bool:
        """Whether it is worth saving again; says nothing about what is saved."""
        ...

    def save(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """Keep this instead of what was saved before, or keep that."""
        ...


class Trainer:
    """A method on its way to being trained.

    What happens in an epoch depends on ``(seed, epoch)`` and on the state at its start alone, so
    a training resumed at an epoch's start ends with the same weights.
    """

    def __init__(
        self,
        method: LearnedMethod,
        train: Pairs,
        val: Pairs,
        budget: Budget,
        fresh: FreshPoses | None,
        *,
        seed: int,
    ) -> None:
        """``fresh`` draws a new pose per pair and epoch; None keeps those of the pair file."""
        self.method, self.train, self.val, self.budget = method, train, val, budget
        self.fresh, self.seed = fresh, seed
        self.optimizer = torch.optim.Adam(method.parameters(), lr=budget.learning_rate, fused=True)
        self.curve: list[Epoch] = []
        self.best: dict[str, Tensor] = {}
        self.best_error, self.best_epoch = math.inf, -1

    @property
    def steps_per_epoch(self) -> int:
        """Batches in an epoch; the last one may be smaller."""
        return math.ceil(self.pairs_per_epoch / self.budget.batch_size)

    @property
    def pairs_per_epoch(self) -> int:
        """Training pairs seen in an epoch."""
        return min(self.budget.epoch_pairs or len(self.train), len(self.train))

    def learning_rate(self, epoch: int, batch: int) -> float:
        """The rate of one step."""
        peak = self.budget.learning_rate
        if self.budget.schedule == "plateau":
            return peak * 0.5 ** halvings(
                [e.losses["loss"] for e in self.curve], self.budget.patience
            )
        share = (epoch + batch / self.steps_per_epoch) / self.budget.epochs
        falling = FLOOR + (1 - FLOOR) * 0.5 * (1 + math.cos(math.pi * share))
        return peak * min(share / WARM_UP + FLOOR, 1.0) * falling

    def run_epoch(self, epoch: int) -> None:
        """Step over the epoch's pairs once, validate if due, keep the weights if best."""
        generator = torch.Generator().manual_seed(_seed(self.seed, epoch))
        sums: dict[str, float] = {}
        for batch, pairs in enumerate(self._batches(epoch)):
            rate = self.learning_rate(epoch, batch)
            for group in self.optimizer.param_groups:
                group["lr"] = rate
            terms = self.method.loss(pairs, generator=generator)
            total = torch.stack(list(terms.values())).sum()
            self.optimizer.zero_grad()
            torch.autograd.backward(total)
            torch.nn.utils.clip_grad_norm_(self.method.parameters(), 10.0, error_if_nonfinite=True)
            self.optimizer.step()
            for name, value in {"loss": total, **terms}.items():
                sums[name] = sums.get(name, 0.0) + value.item() * len(pairs) / self.pairs_per_epoch
        self._close(epoch, rate, sums)

    def _batches(self, epoch: int) -> Iterator[Pairs]:
        order = np.random.default_rng([self.seed, epoch]).permutation(len(self.train))
        drawn = torch.from_numpy(order[: self.pairs_per_epoch])
        for chosen in torch.split(drawn, self.budget.batch_size):
            pairs = self.train.select(chosen)
            yield (
                pairs
                if self.fresh is None
                else repose(pairs, self.fresh, self._draws(chosen, epoch))
            )

    def _draws(self, chosen: Tensor, epoch: int) -> list[np.random.Generator]:
        return [np.random.default_rng([self.seed, epoch, pair]) for pair in chosen.tolist()]

    def _close(self, epoch: int, rate: float, losses: Mapping[str, float]) -> None:
        due = (epoch + 1) % self.budget.validate_every == 0 or epoch + 1 == self.budget.epochs
        error_r, error_t_ = self._validate() if due else (None, None)
        step = (epoch + 1) * self.steps_per_epoch
        self.curve.append(Epoch(epoch, step, rate, losses, error_r, error_t_))
        if error_r is not None and error_r < self.best_error:
            self.best_error, self.best_epoch = error_r, epoch
            weights = self.method.state_dict()
            self.best = {name: value.detach().clone() for name, value in weights.items()}

    def _validate(self) -> tuple[float, float]:
        """Mean errors on the validation pairs, the same noise every time."""
        self.method.eval()
        generator = torch.Generator().manual_seed(self.seed)
        source, target = self.val.clouds(self.method.normals)
        estimates = [
            self.method.register(source[i : i + 1], target[i : i + 1], generator=generator)
            for i in range(len(self.val))
        ]
        self.method.train()
        estimate, truth = torch.cat(estimates).double(), self.val.T_target_source
        return error_r_deg(estimate, truth).mean().item(), error_t(estimate, truth).mean().item()

    def state(self) -> tuple[dict[str, Tensor], dict[str, object]]:
        """Everything the next epoch depends on."""
        tensors = {f"model.{name}": value for name, value in self.method.state_dict().items()}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        for index, moments in self.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{index}.{name}": value for name, value in moments.items()}
        curve = [asdict(epoch) for epoch in self.curve]
        return tensors, {"curve": curve, "best": self.best_error, "best_epoch": self.best_epoch}

    def restore(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """Take over what :meth:`state` gave."""
        split: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "adam": {}}
        for name, value in tensors.items():
            kind, _, rest = name.partition(".")
            split[kind][rest] = value
        self.method.load_state_dict(split["model"])
        self.best = split["best"]
        optimizer = self.optimizer.state_dict()
        for name, value in split["adam"].items():
            index, _, moment = name.partition(".")
            optimizer["state"].setdefault(int(index), {})[moment] = value
        self.optimizer.load_state_dict(optimizer)
        self.curve = [Epoch(**row) for row in record["curve"]]  # type: ignore[attr-defined]
        self.best_error = float(record["best"])  # type: ignore[arg-type]
        self.best_epoch = int(record["best_epoch"])  # type: ignore[call-overload]


def train(
    trainer: Trainer, checkpoint: Checkpoint, progress: Progress = silent
) -> tuple[dict[str, Tensor], list[Epoch]]:
    """Train to the end of the budget, from the checkpoint if there is one.

    Returns:
        The weights of the best validated epoch, and the curve.

    Raises:
        RuntimeError: A gradient is not finite.
    """
    saved = checkpoint.load()
    if saved is None:
        trainer.method.prepare(trainer.train)
    else:
        trainer.restore(*saved)
    epochs = range(len(trainer.curve), trainer.budget.epochs)
    trainer.method.train()
    for epoch in progress(epochs, f"train {trainer.method.name}"):
        trainer.run_epoch(epoch)
        if checkpoint.due():
            checkpoint.save(*trainer.state())
    return trainer.best, trainer.curve


def repose(pairs: Pairs, fresh: FreshPoses, generators: list[np.random.Generator]) -> Pairs:
    """The same pairs under new poses: the target is moved from its old place to its new one."""
    poses = [draw_pose(fresh.max_rotation, fresh.max_translation, generator=g) for g in generators]
    T_new = torch.from_numpy(np.stack(poses))
    T_new_old = T_new @ invert(pairs.T_target_source)
    target = transform(T_new_old, pairs.target.double()).to(pairs.target)
    normals = pairs.target_normals
    if normals is not None:
        normals = (normals.double() @ T_new_old[:, :3, :3].mT).to(normals)
    return replace(pairs, target=target, T_target_source=T_new, target_normals=normals)


def halvings(losses: list[float], patience: int) -> int:
    """How often a falling loss has paused for more than ``patience`` epochs."""
    best, waited, count = math.inf, 0, 0
    for loss in losses:
        waited = 0 if loss < best else waited + 1
        best = min(best, loss)
        if waited > patience:
            count, waited = count + 1, 0
    return count


def _seed(seed: int, epoch: int) -> int:
    return int(np.random.SeedSequence([seed, epoch]).generate_state(1, np.uint64)[0] >> 1)
