"""The second floor of every table: the mean training pose, whatever the clouds are."""

import torch
from jaxtyping import Float64
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.registration import Method, Poses, Sources, Targets


class Constant(Method):
    """Answers the pose that is nearest to all training poses.

    The mean translation, and the rotation that minimises the summed squared Frobenius distance
    to the training rotations: the projection of their mean onto SO(3) (Moakher 2002).
    """

    name = "constant"

    def __init__(self, T_training: Float64[Tensor, "pairs 4 4"]) -> None:
        """``T_training`` are the T_target_source of the training pairs."""
        mean = T_training.mean(dim=0)
        U, _, Vh = torch.linalg.svd(mean[:3, :3])
        U[:, 2] *= torch.det(U @ Vh)
        self.T_target_source = from_parts(U @ Vh, mean[:3, 3])

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """The mean training pose for every pair."""
        return self.T_target_source.to(source).repeat(len(source), 1, 1)
