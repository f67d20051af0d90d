"""Processes that train one method together: what the loop asks of them."""

from collections.abc import Mapping
from typing import Protocol, TypeVar, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.registration import LearnedMethod, Pairs

T = TypeVar("T")


@runtime_checkable
class Loss(Protocol):
    """``LearnedMethod.loss``, or what stands for it."""

    def __call__(
        self, pairs: Pairs, *, generator: torch.Generator
    ) -> Mapping[str, Float[Tensor, ""]]:
        """Each term of the loss by name."""
        ...


@runtime_checkable
class Processes(Protocol):
    """This process among all that take part; each call but ``device`` is made by all of them."""

    rank: int
    """This one's place; 0 writes what there is to write."""
    count: int
    device: torch.device

    def spread(self, method: LearnedMethod) -> Loss:
        """The loss of a method that lies on ``device``.

        All start from the weights of the first process; gradients are means over the processes.
        """
        ...

    def total(self, values: Float[Tensor, "*shape"]) -> Float[Tensor, "*shape"]:
        """The sum over the processes, the same bytes in each of them."""
        ...

    def of_first(self, value: T) -> T:
        """What the first process holds."""
        ...


class Alone:
    """One process, which needs nobody."""

    rank, count, device = 0, 1, torch.device("cpu")

    def spread(self, method: LearnedMethod) -> Loss:
        """Its own loss."""
        return method.loss

    def total(self, values: Float[Tensor, "*shape"]) -> Float[Tensor, "*shape"]:
        """Its own values."""
        return values

    def of_first(self, value: T) -> T:
        """Its own value."""
        return value


ALONE = Alone()
