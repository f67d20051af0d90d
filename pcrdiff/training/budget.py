"""How long and how fast to train, and what an epoch has shown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

WARM_UP, FLOOR = 0.05, 0.02  # share of a cosine schedule spent rising, and where it ends


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


@dataclass(frozen=True)
class Budget:
    """How long and how to train."""

    epochs: int
    batch_size: int
    """Pairs per step and process."""
    learning_rate: float
    schedule: Literal["plateau", "cosine"]
    """Halve when an epoch's loss has stopped falling (the paper's), or fall along a cosine."""
    patience: int
    """Epochs without a better loss before the plateau schedule halves."""
    validate_every: int
    """Epochs between validations; the last epoch is always validated."""
    epoch_pairs: int | None = None
    """Training pairs per epoch, drawn again for each; None takes all of them."""
    points: int | None = None
    """Of each cloud in a step, drawn again for each epoch; None takes all of them."""

    def rate(self, done: float, curve: Sequence[Epoch]) -> float:
        """The learning rate of one step.

        Args:
            done: Epochs trained before this step, with the fraction of the present one.
            curve: The epochs that are complete.
        """
        if self.schedule == "plateau":
            paused = halvings([epoch.losses["loss"] for epoch in curve], self.patience)
            return self.learning_rate * 0.5**paused
        share = done / self.epochs
        falling = FLOOR + (1 - FLOOR) * 0.5 * (1 + math.cos(math.pi * share))
        return self.learning_rate * min(share / WARM_UP + FLOOR, 1.0) * falling

    def validates(self, epoch: int) -> bool:
        """Whether the method is validated after this epoch."""
        return (epoch + 1) % self.validate_every == 0 or epoch + 1 == self.epochs


def halvings(losses: Sequence[float], patience: int) -> int:
    """How often a falling loss has paused for more than ``patience`` epochs."""
    best, waited, count = math.inf, 0, 0
    for loss in losses:
        waited = 0 if loss < best else waited + 1
        best = min(best, loss)
        if waited > patience:
            count, waited = count + 1, 0
    return count
