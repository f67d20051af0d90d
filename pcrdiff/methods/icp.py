"""Point-to-point ICP (Besl & McKay 1992) by Open3D, started where the clouds lie."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.bindings.open3d_registration import cloud, icp
from pcrdiff.registration import check_clouds


class ICP:
    """Every point goes to its nearest neighbour, again and again."""

    name = "icp"

    def __init__(self, max_iterations: int, max_distance: float) -> None:
        """``max_distance`` between matched points, in the clouds' unit."""
        self.max_iterations, self.max_distance = max_iterations, max_distance

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Refine the identity."""
        del generator
        check_clouds(self.name, source, target)
        poses = [
            icp(self.name, cloud(p), cloud(q), np.eye(4), self.max_iterations, self.max_distance)
            for p, q in zip(source, target, strict=True)
        ]
        return torch.from_numpy(np.stack(poses))
