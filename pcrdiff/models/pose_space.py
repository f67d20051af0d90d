"""The space a pose is diffused in: how it is written, and how it is scaled."""

from typing import Literal

import torch
from jaxtyping import Float, Float64
from torch import Tensor, nn

from pcrdiff.diffusion.process import Vectors
from pcrdiff.geometry.representation import REPRESENTATIONS, RepresentationName

Scaling = Literal["raw", "standardised"]
LEAST_DEVIATION = 1e-3  # an entry that hardly varies is not blown up


class PoseSpace(nn.Module):
    """Poses to the vectors of the diffusion and back.

    The paper diffuses the vector as it is, ``raw``: of its seven entries those of the rotation
    vary by a tenth, next to noise of deviation 1 (reports/DEVIATIONS.md). ``standardised``
    vectors have mean 0 and deviation 1 in each entry over the training poses.
    """

    mean: Tensor
    deviation: Tensor
    start: Tensor

    def __init__(self, representation: RepresentationName, scaling: Scaling) -> None:
        super().__init__()
        self.representation, self.scaling = REPRESENTATIONS[representation], scaling
        self.dim = self.representation.dim
        self.register_buffer("mean", torch.zeros(self.dim))
        self.register_buffer("deviation", torch.ones(self.dim))
        self.register_buffer("start", self.representation.identity)

    def fit(self, T_target_source: Float64[Tensor, "poses 4 4"]) -> None:
        """Take mean and deviation from the training poses; raw vectors have no use for them."""
        if self.scaling == "raw":
            return
        vectors = self.representation.encode(T_target_source)
        self.mean.copy_(vectors.mean(dim=0))
        self.start.copy_(self.mean)
        self.deviation.copy_(vectors.std(dim=0, correction=0).clamp(min=LEAST_DEVIATION))

    def encode(self, T_target_source: Float[Tensor, "batch 4 4"]) -> Vectors:
        """The vector of a pose: what is diffused, G_0."""
        vector = self.representation.encode(T_target_source)
        return (vector - self.mean.to(vector)) / self.deviation.to(vector)

    def decode(self, x: Vectors) -> Float[Tensor, "batch 4 4"]:
        """The pose a vector stands for; any vector stands for one."""
        T: Tensor = self.representation.decode(x * self.deviation.to(x) + self.mean.to(x))
        return T

    def step(self, raw: Vectors) -> Vectors:
        """What a network's output means: a step from the identity, or from the mean pose."""
        vector = self.representation.tidy(self.start + self.deviation * raw)
        return (vector - self.mean) / self.deviation
