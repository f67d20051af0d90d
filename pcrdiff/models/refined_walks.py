"""The ends of several walks as starts of a refinement."""

from dataclasses import replace
from typing import Any

import torch

from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.registration import Source, Target


class RefinedWalks(VerifiedMethod):
    """A method that diffuses the pose: several of its walks, refined; the best fit is the answer."""

    def __init__(self, method: DiffusedMethod[Any], starts: int, refinement: Refinement) -> None:
        """``starts`` is the number of walks."""
        self.method, self.starts, self.refinement = method, starts, refinement
        self.name, self.least_points = method.name, method.least_points

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """The end of every walk."""
        p, q = source.unsqueeze(0), target.unsqueeze(0)
        encoded, walk = self.method.encode(p, q), replace(self.method.walk, hypotheses=count)
        return self.method.propose(encoded, p, walk, generator=generator)[:, 0]
