"""Long loops, without the library ever printing or knowing where they are done."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Protocol, TypeVar, runtime_checkable

T = TypeVar("T")
Item = TypeVar("Item")
Result = TypeVar("Result")


@runtime_checkable
class Progress(Protocol):
    """Wraps a sequence so that somebody may watch it being walked; draws nothing on its own."""

    def __call__(self, items: Sequence[T], description: str) -> Iterable[T]:
        """Yield ``items`` in order."""
        ...


def silent(items: Sequence[T], description: str) -> Iterable[T]:
    """Nobody watches."""
    del description
    return items


@runtime_checkable
class Spread(Protocol):
    """Maps a function over items, lazily and in their order; somewhere, maybe several at once.

    The function and the items can be pickled, and a result depends on nothing but its item.
    """

    def __call__(
        self, function: Callable[[Item], Result], items: Iterable[Item]
    ) -> Iterator[Result]:
        """Yield ``function(item)`` of every item; what it raises is raised here."""
        ...


def in_turn(function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
    """Here, one after the other."""
    return map(function, items)
