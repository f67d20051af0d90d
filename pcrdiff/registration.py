"""The project's nouns: what is registered, and who registers it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Literal

import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor, nn

SPLITS = ("train", "val", "test")
EVIDENCE = ("residual", "overlap", "agreement", "margin", "close", "sharpness")
"""What speaks for an answer, where a method says it: see ``pcrdiff.hypotheses.Verified``."""
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
    shape: Float[Tensor, "pairs points 3"] | None = None
    """The whole item, without noise, in the source's frame; where it is kept to measure answers by."""

    def __len__(self) -> int:
        """How many pairs."""
        return len(self.source)

    def select(self, index: Int64[Tensor, " chosen"]) -> "Pairs":
        """The pairs at ``index``, in its order."""
        group = tuple(self.group[i] for i in index.tolist())
        chosen = self._each(lambda values: values[index])
        return replace(self, item=self.item[index], group=group, **chosen)

    def take_points(
        self, source: Int64[Tensor, "pairs few"], target: Int64[Tensor, "pairs fewer"]
    ) -> "Pairs":
        """The same pairs with those points of each cloud that are named, and their normals."""
        rows = torch.arange(len(self))[:, None]
        index = {"source": source, "target": target}
        kept = {
            name: values[rows, index[name.removesuffix("_normals")]]
            for name, values in self._each(lambda values: values).items()
            if name.removesuffix("_normals") in index
        }
        return replace(self, **kept)

    def to(self, device: torch.device) -> "Pairs":
        """The same pairs on a device; ``item`` stays where it is."""
        return replace(self, **self._each(lambda values: values.to(device)))

    def _each(self, change: Callable[[Tensor], Tensor]) -> dict[str, Any]:
        """The changed poses, clouds, normals and shapes by their names, where there are any."""
        names = ("source", "target", "T_target_source", "source_normals", "target_normals", "shape")
        values = {name: getattr(self, name) for name in names}
        return {name: change(value) for name, value in values.items() if value is not None}

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


Sources = Float[Tensor, "batch n channels"]
"""The clouds that move: 3 channels, or 6 with unit normals for a method that is given normals."""
Targets = Float[Tensor, "batch m channels"]
"""The clouds that stay, with the same channels."""
Poses = Float[Tensor, "batch 4 4"]
"""Their T_target_source."""
Source = Float[Tensor, "n 3"]
Target = Float[Tensor, "m 3"]
Pose = Float64[Tensor, "4 4"]
"""The same for a single pair."""
Scalar = Float[Tensor, ""]
Losses = Mapping[str, Scalar]
"""Each term of a loss by name; what is minimised is their sum."""


class Method(ABC):
    """One row of the results table."""

    name: str
    normals: Normals = "estimated"
    """Whether its clouds come with the data set's normals; see ``Pairs.clouds``."""
    least_points: int = 3
    """The number of distinct points that a cloud needs."""

    def register(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """Estimate T_target_source, without a gradient.

        Args:
            source: The clouds that move.
            target: The clouds that stay.
            generator: Source of randomness.

        Raises:
            ValueError: A cloud is empty, too small for the method, or not finite, or the method
                found no pose.
            RuntimeError: A library that the method calls has failed.
        """
        with self.checked(source, target):
            return self.answer(source, target, generator=generator)

    @contextmanager
    def checked(self, source: Sources, target: Targets) -> Iterator[None]:
        """Refuse clouds that the method cannot read; what is done with others keeps no gradient.

        Raises:
            ValueError: A cloud is empty, too small for the method, or not finite.
        """
        check_clouds(self.name, source, target, self.least_points)
        with torch.no_grad():
            yield

    @abstractmethod
    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """What :meth:`register` returns for clouds that have passed its checks."""


class PairwiseMethod(Method):
    """A method that answers one pair after the other."""

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """The answer to each pair; all draw from one generator."""
        pairs = zip(source, target, strict=True)
        return torch.stack([self.answer_pair(p, q, generator=generator) for p, q in pairs])

    @abstractmethod
    def answer_pair(self, source: Source, target: Target, *, generator: torch.Generator) -> Pose:
        """Estimate T_target_source of one pair.

        Raises:
            ValueError: The method found no pose.
        """


class LearnedMethod(nn.Module, Method):
    """A method with weights: ``training`` minimises the sum of its ``loss`` terms."""

    def prepare(self, pairs: Pairs) -> None:
        """Take from the training pairs what no gradient teaches, before the first step."""

    @abstractmethod
    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """The terms of the loss on a batch of pairs."""


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
