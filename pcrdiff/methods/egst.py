"""EGST (Yuan et al. 2024): structured features and attention to soft matches to a pose, twice."""

from jaxtyping import Float
from torch import Tensor

from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.refinement import Features, Points, RefinedMethod
from pcrdiff.models.structure import DESCRIPTOR_DIM, describe


class EGST(RefinedMethod):
    """PCRDiffusion CB's decoder without the diffusion, as its authors published it.

    Features have 128 entries by the authors. It is trained with RPM-Net's losses; EGST's own are
    not public.
    """

    name = "egst"
    descriptor_dim = DESCRIPTOR_DIM

    def add_layers(self, feature_dim: int) -> None:
        """The attention between the clouds."""
        self.attention = CrossCloudAttention(dim=feature_dim)

    def describe(self, points: Points, normals: Points | None) -> Float[Tensor, "batch n k 11"]:
        """The three descriptors of each neighbourhood."""
        return describe(points, normals, self.radius, self.neighbours)

    def relate(
        self, source: Float[Tensor, "batch n dim"], target: Float[Tensor, "batch m dim"]
    ) -> Features:
        """The features after attention to the other cloud."""
        return self.attention(source, target), self.attention(target, source)
