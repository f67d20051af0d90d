"""The ends of several walks as starts of a refinement."""

from typing import Any

import torch

from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.registration import Source, Target


class RefinedWalks(VerifiedMethod):
    """A method that diffuses the pose, refined; of its ``hypotheses`` the best fit is the answer."""

    def __init__(self, method: DiffusedMethod[Any], refinement: Refinement) -> None:
        self.method, self.refinement = method, refinement
        self.name, self.least_points = method.name, method.least_points

    def propose(self, source: Source, target: Target, *, generator: torch.Generator) -> Starts:
        """The end of every walk."""
        p, q = source.unsqueeze(0), target.unsqueeze(0)
        encoded = self.method.encode(p, q)
        return self.method.propose(encoded, p, self.method.walk, generator=generator)[:, 0]
