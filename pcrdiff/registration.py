"""The project's nouns: what is registered, and who registers it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor, nn

SPLITS = ("train", "val", "test")
Normals = Literal["given", "estimated"]
"""The data set's own, clean ones, or none: a method estimates them from the points it is given."""


@dataclass(frozen=True)
class Pairs:
    """Registration problems with known answers; see ``pipeline.formats.pairs`` for the file."""

    source: Float[Tensor, "pairs n 3"]
    target: Float[Tensor, "pairs m 3"]
    T_target_source: Float64[Tensor, "pairs 4 4"]
    item: Int64[Tensor, " pairs"]
    """Index of the raw item in its data set; several pairs may show one item."""
    group: tuple[str, ...]
    """Category or scene of each pair."""
    source_normals: Float[Tensor, "pairs n 3"] | None = None
    """Unit normals that the data set gave, where the scenario keeps them; both clouds' or none."""
    target_normals: Float[Tensor, "pairs m 3"] | None = None

    def __len__(self) -> int:
        """How many pairs."""
        return len(self.source)

    def select(self, index: Int64[Tensor, " chosen"]) -> "Pairs":
        """The pairs at ``index``, in its order."""
        group = tuple(self.group[i] for i in index.tolist())
        normals = (self.source_normals, self.target_normals)
        return Pairs(
            self.source[index],
            self.target[index],
            self.T_target_source[index],
            self.item[index],
            group,
            *(None if each is None else each[index] for each in normals),
        )

    def to(self, device: torch.device) -> "Pairs":
        """The same pairs on a device; ``item`` stays where it is."""
        normals = (self.source_normals, self.target_normals)
        return Pairs(
            self.source.to(device),
            self.target.to(device),
            self.T_target_source.to(device),
            self.item,
            self.group,
            *(None if each is None else each.to(device) for each in normals),
        )

    def clouds(
        self, normals: Normals
    ) -> tuple[Float[Tensor, "pairs n channels"], Float[Tensor, "pairs m channels"]]:
        """Source and target as a method wants them: points, and if given beside them the normals.

        Raises:
            ValueError: Normals are to be given, and there are none.
        """
        if normals == "estimated":
            return self.source, self.target
        if self.source_normals is None or self.target_normals is None:
            raise ValueError("the pairs hold no normals, their scenario needs `normals: given`")
        return (
            torch.cat([self.source, self.source_normals], dim=-1),
            torch.cat([self.target, self.target_normals], dim=-1),
        )


@runtime_checkable
class Method(Protocol):
    """One row of the results table."""

    name: str

    def register(
        self,
        source: Float[Tensor, "batch n channels"],
        target: Float[Tensor, "batch m channels"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source.

        Args:
            source: The cloud that moves: 3 channels, or 6 with unit normals for a method whose
                attribute ``normals`` is ``given``.
            target: The cloud that stays, alike.
            generator: Source of randomness.

        Raises:
            ValueError: A cloud is empty, too small for the method, or not finite.
        """
        ...


class LearnedMethod(nn.Module, ABC):
    """A method with weights: ``training`` minimises the sum of its ``loss`` terms."""

    name: str
    normals: Normals = "estimated"
    """Whether its clouds come with the data set's normals; see ``Pairs.clouds``."""

    def prepare(self, pairs: Pairs) -> None:
        """Take from the training pairs what no gradient teaches, before the first step."""

    @abstractmethod
    def register(
        self,
        source: Float[Tensor, "batch n channels"],
        target: Float[Tensor, "batch m channels"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Estimate T_target_source; see :class:`Method`."""

    @abstractmethod
    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Each term of the loss by name; what is minimised is their sum."""


def check_clouds(
    who: str,
    source: Float[Tensor, "batch n channels"],
    target: Float[Tensor, "batch m channels"],
    minimum: int = 3,
) -> None:
    """Refuse clouds that no pose can be read from.

    Raises:
        ValueError: A cloud has neither 3 channels nor 6, for normals; fewer than ``minimum``
            distinct points; or a number that is not finite.
    """
    for name, cloud in (("source", source), ("target", target)):
        if cloud.shape[-1] not in (3, 6):
            raise ValueError(
                f"{who} needs 3 or 6 channels, got a {name} cloud of {cloud.shape[-1]}"
            )
        if not torch.isfinite(cloud).all():
            raise ValueError(f"{who} needs finite points, got a {name} cloud with NaN or infinity")
        distinct = min((_count_distinct(item, minimum) for item in cloud[..., :3]), default=0)
        if distinct < minimum:
            raise ValueError(
                f"{who} needs at least {minimum} distinct points, got a {name} cloud of {distinct}"
            )


def _count_distinct(points: Float[Tensor, "n 3"], enough: int) -> int:
    """How many points are distinct, exactly if fewer than ``enough``; the first few may suffice."""
    few = len(torch.unique(points[: 2 * enough], dim=0))
    return few if few >= enough else len(torch.unique(points, dim=0))
