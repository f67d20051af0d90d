"""One loop for every learned method: step, validate, keep the best."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.diffusion.shares import Share, SharedGenerator
from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.random_pose import draw_pose
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.loops import Progress, silent
from pcrdiff.processes import ALONE, Loss, Processes
from pcrdiff.registration import LearnedMethod, Pairs

WARM_UP, FLOOR = 0.05, 0.02  # share of a cosine schedule spent rising, and where it ends


@dataclass(frozen=True)
class Budget:
    """How long and how to train."""

    epochs: int
    batch_size: int
    """Pairs in a step, per process."""
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


class NotFiniteError(ArithmeticError):
    """A loss or a gradient that no step can be taken from."""


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

    Several processes step together over batches as many times larger, each on every
    ``processes.count``-th row. They draw alike and hold the same state; but for the order in which
    sums are taken they learn what one process learns from those batches.
    """

    def __init__(  # noqa: PLR0913 - what is trained, on what, how, from which draws and with whom
        self,
        method: LearnedMethod,
        train: Pairs,
        val: Pairs,
        budget: Budget,
        fresh: FreshPoses | None,
        *,
        seed: int,
        processes: Processes = ALONE,
    ) -> None:
        """``fresh`` draws a new pose per pair and epoch; None keeps those of the pair file."""
        self.method, self.train, self.val, self.budget = method, train, val, budget
        self.fresh, self.seed, self.processes = fresh, seed, processes
        self.loss: Loss = method.to(processes.device).loss
        self.noise: dict[int, Tensor] | None = None
        self.optimizer = torch.optim.Adam(method.parameters(), lr=budget.learning_rate, fused=True)
        self.curve: list[Epoch] = []
        self.best: dict[str, Tensor] = {}
        self.best_error, self.best_epoch = math.inf, -1

    @property
    def steps_per_epoch(self) -> int:
        """Batches in an epoch; the last one may be smaller."""
        return math.ceil(self.pairs_per_epoch / self.batch_size)

    @property
    def batch_size(self) -> int:
        """Pairs in a step, of all processes together."""
        return self.budget.batch_size * self.processes.count

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
        generator = SharedGenerator()
        generator.manual_seed(_seed(self.seed, epoch))
        sums: dict[str, float] = {}
        for batch, (generator.share, pairs) in enumerate(self._batches(epoch)):
            rate = self.learning_rate(epoch, batch)
            for group in self.optimizer.param_groups:
                group["lr"] = rate
            try:
                terms = self.loss(pairs.to(self.processes.device), generator=generator)
                total = torch.stack(list(terms.values())).sum()
                self._step(total * (generator.share.weight * self.processes.count))
            except (NotFiniteError, torch.linalg.LinAlgError) as error:  # type: ignore[attr-defined]
                raise RuntimeError(self._what_failed(epoch, batch, error)) from error
            part = generator.share.count
            for name, value in {"loss": total, **terms}.items():
                sums[name] = sums.get(name, 0.0) + value.item() * part / self.pairs_per_epoch
        self._close(epoch, rate, self._total(sums))

    def _step(self, loss: Tensor) -> None:
        """Follow the gradient, cut to length 10; of several processes, the mean of theirs."""
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        norm = torch.nn.utils.clip_grad_norm_(self.method.parameters(), 10.0)
        if not torch.isfinite(torch.stack([norm, loss.detach()])).all():
            raise NotFiniteError(f"loss {loss.item():g}, gradient of length {norm.item():g}")
        self.optimizer.step()

    def _what_failed(self, epoch: int, batch: int, error: Exception) -> str:
        """The sentence on a step that was not taken; it names the whole batch, of all processes."""
        items = self.train.item[self._drawn(epoch)[batch]].tolist()
        return (
            f"{self.method.name} needs a finite loss and gradient, got a non-finite one in epoch "
            f"{epoch} from the pairs of items {items}: {str(error).splitlines()[0]}"
        )

    def _drawn(self, epoch: int) -> tuple[Tensor, ...]:
        """The training pairs of each batch of an epoch, by their place among all."""
        order = np.random.default_rng([self.seed, epoch]).permutation(len(self.train))
        return torch.split(torch.from_numpy(order[: self.pairs_per_epoch]), self.batch_size)

    def _total(self, losses: Mapping[str, float]) -> dict[str, float]:
        """The losses of all processes from the parts of each."""
        values = torch.tensor(list(losses.values()), dtype=torch.float64)
        return dict(zip(losses, self.processes.total(values).tolist(), strict=True))

    def _batches(self, epoch: int) -> Iterator[tuple[Share, Pairs]]:
        """This process's share of each batch, and the pairs that it holds."""
        for batch in self._drawn(epoch):
            share = Share(len(batch), self.processes.rank, self.processes.count)
            chosen = batch[share.rows]
            pairs = self.train.select(chosen)
            if self.fresh is not None:
                pairs = repose(pairs, self.fresh, self._draws(chosen, epoch))
            yield share, pairs

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
        estimate, truth = self._estimates(), self.val.T_target_source
        self.method.train()
        return error_r_deg(estimate, truth).mean().item(), error_t(estimate, truth).mean().item()

    def _estimates(self) -> Float64[Tensor, "pairs 4 4"]:
        """The pose of each validation pair.

        One generator serves all pairs, one after the other. The first time each process goes over
        all of them and notes how the generator stands at its own; from then on they share them.
        """
        generator = torch.Generator().manual_seed(self.seed)
        source, target = self.val.clouds(self.method.normals)

        def register(i: int) -> Float[Tensor, "4 4"]:
            clouds = (cloud[i : i + 1].to(self.processes.device) for cloud in (source, target))
            return self.method.register(*clouds, generator=generator)[0]

        poses = torch.zeros(len(self.val), 4, 4, dtype=torch.float64)
        if self.noise is not None:
            for i, state in self.noise.items():
                generator.set_state(state)
                poses[i] = register(i)
            return self.processes.total(poses)
        states = []
        for i in range(len(self.val)):
            states.append(generator.get_state())
            poses[i] = register(i)
        rank, count = self.processes.rank, self.processes.count
        if count > 1:
            self.noise = {i: states[i] for i in range(rank, len(self.val), count)}
        return poses

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

    Of several processes, all go on from the checkpoint of the first.

    Returns:
        The weights of the best validated epoch, and the curve.

    Raises:
        RuntimeError: A loss or gradient is not finite; the sentence names the pairs of its batch.
    """
    saved = trainer.processes.of_first(checkpoint.load())
    if saved is None:
        trainer.method.prepare(trainer.train)
    else:
        trainer.restore(*saved)
    trainer.loss = trainer.processes.spread(trainer.method)
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
