"""What the results say of each claim of the paper: the page "What we found"."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pipeline.tables import Row

Verdict = Literal["confirmed", "not confirmed", "undecided", "not run"]


@dataclass(frozen=True)
class Finding:
    """One claim, and what our numbers say of it."""

    topic: str
    """Order of methods, diffusion, representation, fusion, steps, speed, ..."""
    claim: str
    """What the paper says, with its numbers."""
    ours: tuple[str, ...]
    """Sentences, each with a number and its interval."""
    verdict: Verdict


def make_findings(rows: Sequence[Row]) -> list[Finding]:
    """Weigh every claim of the paper against the rows of ``results.csv``."""
    return []
