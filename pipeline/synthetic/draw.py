"""Draws of sizes and choices, all from one generator."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Choice = TypeVar("Choice")


@dataclass(frozen=True)
class Draw:
    """A generator in the words of those who make shapes: ``draw(0.4, 0.6)`` is a size between."""

    generator: np.random.Generator

    def __call__(self, low: float | int, high: float | int) -> float:
        """A number between two others."""
        return self.generator.uniform(low, high)

    def whole(self, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``, both included."""
        return int(self.generator.integers(low, high, endpoint=True))

    def pick(self, options: Sequence[Choice]) -> Choice:
        """One of several, each as likely."""
        return options[self.whole(0, len(options) - 1)]

    def chance(self, share: float) -> bool:
        """True in this share of the draws."""
        return self.generator.random() < share

    def maybe(self, share: float, *things: Choice) -> tuple[Choice, ...]:
        """The things in this share of the draws, else nothing."""
        return things if self.chance(share) else ()
