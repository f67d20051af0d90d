"""Generalized ICP from many random starts: the floor under every source of starts that is learned."""

import torch
from jaxtyping import Float64
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.registration import Source, Target


class GICPMultistart(VerifiedMethod):
    """Rotations of random training poses, each about the centroids; the best fit is the answer.

    Knows of the training data what ``constant`` knows: how poses are spread.
    """

    name = "gicp_multistart"

    def __init__(
        self, T_training: Float64[Tensor, "pairs 4 4"], starts: int, refinement: Refinement
    ) -> None:
        """``T_training`` are the T_target_source of the training pairs, ``starts`` how many."""
        self.rotations, self.starts, self.refinement = T_training[:, :3, :3], starts, refinement

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """Rotations drawn with replacement; each lays the source's centroid on the target's."""
        chosen = torch.randint(len(self.rotations), (count,), generator=generator)
        R, p, q = self.rotations[chosen], source.double().mean(dim=0), target.double().mean(dim=0)
        return from_parts(R, q - R @ p)
