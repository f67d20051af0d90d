"""RANSAC on FPFH features (Fischler & Bolles 1981; Rusu et al. 2009) by Open3D."""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.bindings.open3d_registration import ransac_fpfh
from pcrdiff.registration import check_clouds


class RansacFPFH:
    """Matches FPFH features once and keeps the pose of three matches that most others support.

    Open3D's documented settings, see :func:`pcrdiff.bindings.open3d_registration.ransac_fpfh`; the distances that
    its examples measure in voxels are lengths here, and nothing is thinned to voxels.
    """

    name = "ransac_fpfh"

    def __init__(
        self,
        max_distance: float,
        feature_radius: float,
        feature_neighbours: int,
        normal_radius: float,
    ) -> None:
        """Distances and radii are in the clouds' own unit."""
        self.max_distance = max_distance
        self.feature = (feature_radius, feature_neighbours, normal_radius)

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Match and fit; the generator decides which matches are tried."""
        check_clouds(self.name, source, target)
        poses = [
            ransac_fpfh(self.name, p, q, self.max_distance, self.feature, generator=generator)
            for p, q in zip(source, target, strict=True)
        ]
        return torch.from_numpy(np.stack(poses))
