"""One loop for every learned method: step, validate, keep the best."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
import torch
from torch import Tensor

from pcrdiff.diffusion.shares import Share, SharedGenerator
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.loops import Progress, silent
from pcrdiff.registration import LearnedMethod, Pairs
from pcrdiff.training.budget import Budget, Epoch
from pcrdiff.training.poses import repose
from pcrdiff.training.ranks import ALONE, Loss, Processes
from pcrdiff.training.state import Checkpoint, State
from pcrdiff.training.thinning import thin
from pcrdiff.training.validation import Validation

GRADIENT_NORM = 10.0
"""The length that longer gradients are clipped to."""


class NotFiniteError(ArithmeticError):
    """A loss or a gradient that no step can be taken from."""


class Trainer:
    """A method in training.

    What happens in an epoch depends on ``(seed, epoch)`` and on the state at its start alone, so
    a training resumed at an epoch's start ends with the same weights.

    Several processes step together over batches that are larger by their number, each on every
    ``processes.count``-th row. They draw the same numbers and hold the same state; but for the
    order of summation they learn what one process learns from those batches.
    """

    def __init__(  # noqa: PLR0913 - what is trained, on what, how, from which draws and with whom
        self,
        method: LearnedMethod,
        train: Pairs,
        val: Pairs,
        budget: Budget,
        fresh: PoseRange | None,
        *,
        seed: int,
        processes: Processes = ALONE,
    ) -> None:
        """``fresh`` draws a new pose per pair and epoch; None keeps those of the pair file."""
        self.method, self.train, self.budget, self.fresh = method, train, budget, fresh
        self.seed, self.processes = seed, processes
        self.loss: Loss = method.to(processes.device).loss
        self.optimizer = torch.optim.Adam(method.parameters(), lr=budget.learning_rate, fused=True)
        self.validation = Validation(val, seed=seed, processes=processes)
        self.state = State(method, self.optimizer)

    @property
    def batch_size(self) -> int:
        """Pairs per step, of all processes together."""
        return self.budget.batch_size * self.processes.count

    @property
    def pairs_per_epoch(self) -> int:
        """Training pairs per epoch."""
        return min(self.budget.epoch_pairs or len(self.train), len(self.train))

    @property
    def steps_per_epoch(self) -> int:
        """Batches per epoch; the last one may be smaller."""
        return math.ceil(self.pairs_per_epoch / self.batch_size)

    def learning_rate(self, epoch: int, batch: int) -> float:
        """The rate of one step."""
        return self.budget.rate(epoch + batch / self.steps_per_epoch, self.state.curve)

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
        """Follow the clipped gradient; of several processes, the mean of theirs."""
        self.optimizer.zero_grad()
        torch.autograd.backward(loss)
        norm = torch.nn.utils.clip_grad_norm_(self.method.parameters(), GRADIENT_NORM)
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
            seeds = ([self.seed, epoch, pair] for pair in chosen.tolist())
            generators = [np.random.default_rng(seed) for seed in seeds]
            if self.fresh is not None:
                pairs = repose(pairs, self.fresh, generators)
            if self.budget.points is not None:
                pairs = thin(pairs, self.budget.points, generators)
            yield share, pairs

    def _close(self, epoch: int, rate: float, losses: Mapping[str, float]) -> None:
        due = self.budget.validates(epoch)
        errors = self.validation.errors(self.method) if due else (None, None)
        step = (epoch + 1) * self.steps_per_epoch
        self.state.close(Epoch(epoch, step, rate, losses, *errors))


def train(
    trainer: Trainer, checkpoint: Checkpoint, progress: Progress = silent
) -> tuple[dict[str, Tensor], list[Epoch]]:
    """Train to the end of the budget, from the checkpoint if there is one.

    Several processes all continue from the checkpoint of the first.

    Returns:
        The weights of the best validated epoch, and the curve.

    Raises:
        RuntimeError: A loss or gradient is not finite; the sentence names the pairs of its batch.
    """
    state, saved = trainer.state, trainer.processes.of_first(checkpoint.load())
    if saved is None:
        trainer.method.prepare(trainer.train)
    else:
        state.unpack(*saved)
    trainer.loss = trainer.processes.spread(trainer.method)
    epochs = range(len(state.curve), trainer.budget.epochs)
    trainer.method.train()
    for epoch in progress(epochs, f"train {trainer.method.name}"):
        trainer.run_epoch(epoch)
        if checkpoint.due():
            checkpoint.save(*state.pack())
    return state.best, state.curve


def _seed(seed: int, epoch: int) -> int:
    return int(np.random.SeedSequence([seed, epoch]).generate_state(1, np.uint64)[0] >> 1)
