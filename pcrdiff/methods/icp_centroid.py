"""The third floor of every table: ICP started from the shift between the centroids."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.bindings.open3d_registration import centroid_shift, cloud, icp
from pcrdiff.registration import check_clouds


class ICPCentroid:
    """Point-to-point ICP that is spared the translation; solves full overlap by itself."""

    name = "icp_centroid"

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
        """Refine the shift that lays the source's centroid on the target's."""
        del generator
        check_clouds(self.name, source, target)
        poses = [
            icp(self.name, cloud(p), cloud(q), T, self.max_iterations, self.max_distance)
            for p, q, T in zip(source, target, centroid_shift(source, target), strict=True)
        ]
        return torch.from_numpy(np.stack(poses))
