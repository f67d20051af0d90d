"""Drawing for a batch of which this process may hold only some rows."""

from dataclasses import dataclass

import torch


@dataclass(frozen=True)
class Share:
    """The rows of a batch that one of several processes holds: every ``processes``-th."""

    batch: int
    """Rows of the whole batch."""
    rank: int = 0
    processes: int = 1

    @property
    def count(self) -> int:
        """The number of these rows; 0 for the last processes if the batch has fewer rows."""
        return len(range(self.rank, self.batch, self.processes))

    @property
    def rows(self) -> slice:
        """Which rows to work on; a process with no rows computes the first, with weight 0."""
        return slice(self.rank, None, self.processes) if self.count else slice(0, 1)

    @property
    def weight(self) -> float:
        """The part that a mean over these rows has in the mean over the batch."""
        return self.count / self.batch


class SharedGenerator(torch.Generator):
    """Draws what a single process with the whole batch would draw.

    All processes use the same seed. What is drawn row by row is drawn for the whole batch, and
    each process keeps its ``share`` (:func:`rows_drawn`); so no row's noise depends on the number
    of processes, and the generators stay in step.
    """

    share: Share | None = None
    """This process's share of the current batch; None if it holds all of it."""


def rows_drawn(rows: int, generator: torch.Generator) -> tuple[int, slice]:
    """The number of rows to draw for ``rows`` held here, and which of those drawn to keep."""
    share = generator.share if isinstance(generator, SharedGenerator) else None
    return (rows, slice(None)) if share is None else (share.batch, share.rows)
