"""The project's nouns: what is registered, and who registers it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor, nn

SPLITS = ("train", "val", "test")


@dataclass(frozen=True)
class Pairs:
    """Registration problems with known answers; see ``pipeline.artifacts`` for the file."""

    source: Float[Tensor, "pairs n 3"]
    target: Float[Tensor, "pairs m 3"]
    T_target_source: Float64[Tensor, "pairs 4 4"]
    item: Int64[Tensor, " pairs"]
    """Index of the raw item in its data set; several pairs may show one item."""
    group: tuple[str, ...]
    """Category or scene of each pair."""

    def __len__(self) -> int:
        """How many pairs."""
        return len(self.source)

    def select(self, index: Int64[Tensor, " chosen"]) -> "Pairs":
        """The pairs at ``index``, in its order."""
        group = tuple(self.group[i] for i in index.tolist())
        return Pairs(
            self.source[index],
            self.target[index],
            self.T_target_source[index],
            self.item[index],
            group,
        )


@runtime_checkable
class Method(Protocol):
    """One row of the results table."""

    name: str

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source.

        Raises:
            ValueError: A cloud is empty, too small for the method, or not finite.
        """
        ...


class LearnedMethod(nn.Module):
    """A method with weights: ``training`` minimises the sum of its ``loss`` terms."""

    name: str

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source; see :class:`Method`."""
        raise NotImplementedError

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Each term of the loss by name; what is minimised is their sum."""
        raise NotImplementedError


def check_clouds(
    who: str,
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    minimum: int = 3,
) -> None:
    """Refuse clouds that no pose can be read from.

    Raises:
        ValueError: A cloud has fewer than ``minimum`` distinct points or one that is not finite.
    """
    for name, cloud in (("source", source), ("target", target)):
        if not torch.isfinite(cloud).all():
            raise ValueError(f"{who} needs finite points, got a {name} cloud with NaN or infinity")
        distinct = min((len(torch.unique(item, dim=0)) for item in cloud), default=0)
        if distinct < minimum:
            raise ValueError(
                f"{who} needs at least {minimum} distinct points, got a {name} cloud of {distinct}"
            )
