"""Saying how far a long loop is, without the library ever printing."""

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar, runtime_checkable

T = TypeVar("T")


@runtime_checkable
class Progress(Protocol):
    """Wraps a sequence so that somebody may watch it being walked; draws nothing by itself."""

    def __call__(self, items: Sequence[T], description: str) -> Iterable[T]:
        """Yield ``items`` in order."""
        ...


def silent(items: Sequence[T], description: str) -> Iterable[T]:
    """Nobody watches."""
    del description
    return items
