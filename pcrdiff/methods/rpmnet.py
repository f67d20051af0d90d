"""RPM-Net (Yew & Lee 2020): soft matches of learned features, a pose, and again."""

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.models.refinement import Points, RefinedMethod
from pcrdiff.models.structure import PAIR_DIM, describe_pairs


class RPMNet(RefinedMethod):
    """Point pair features, mapped to unit vectors, which have 96 entries by the authors."""

    name = "rpmnet"
    descriptor_dim = PAIR_DIM

    def describe(self, points: Points, normals: Points | None) -> Float[Tensor, "batch n k 10"]:
        """The pair features of each neighbourhood."""
        return describe_pairs(points, normals, self.radius, self.neighbours)

    def embed(self, descriptors: Float[Tensor, "batch n k 10"]) -> Float[Tensor, "batch n dim"]:
        """A unit feature of each point."""
        return normalize(super().embed(descriptors), dim=-1)
