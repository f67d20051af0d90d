"""Doing many independent things, without the library ever knowing where they are done."""

from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar, runtime_checkable

Item = TypeVar("Item")
Result = TypeVar("Result")


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
