"""Fast Global Registration (Zhou, Park & Koltun 2016) by Open3D."""

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import check_matches, cloud, fpfh, registration
from pcrdiff.geometry.span import TOLERANCE
from pcrdiff.registration import check_clouds


class FGR:
    """Matches FPFH features once, then fits a pose that forgives the wrong ones."""

    name = "fgr"

    def __init__(
        self,
        iterations: int,
        max_distance: float,
        feature_radius: float,
        feature_neighbours: int,
        normal_radius: float,
    ) -> None:
        """Distances and radii are in the clouds' own unit, not in shares of their size."""
        self.iterations, self.max_distance = iterations, max_distance
        self.feature = (feature_radius, feature_neighbours, normal_radius)

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Match and fit; the generator decides which matches are tested in triples."""
        check_clouds(self.name, source, target)
        poses = [self._register(p, q, generator) for p, q in zip(source, target, strict=True)]
        return torch.from_numpy(np.stack(poses))

    def _register(
        self, source: Float[Tensor, "n 3"], target: Float[Tensor, "m 3"], generator: torch.Generator
    ) -> Float64[np.ndarray, "4 4"]:
        seed = int(torch.randint(2**31 - 1, (), generator=generator))
        open3d.utility.random.seed(seed)
        p, q = cloud(source), cloud(target)
        option = registration.FastGlobalRegistrationOption(
            use_absolute_scale=True,
            maximum_correspondence_distance=self.max_distance,
            iteration_number=self.iterations,
        )
        result = registration.registration_fgr_based_on_feature_matching(
            p, q, fpfh(p, *self.feature), fpfh(q, *self.feature), option
        )
        pose = check_matches(self.name, p, q, result, self.max_distance)
        if (pose[:3, :3] == np.eye(3)).all() and not _lies_on(p, q, result):
            raise ValueError(
                f"{self.name} needs features that agree on a pose, got none and the shift between "
                "the centroids"
            )
        return pose


def _lies_on(
    source: "open3d.geometry.PointCloud",
    target: "open3d.geometry.PointCloud",
    result: "open3d.pipelines.registration.RegistrationResult",
) -> bool:
    """Whether the answer lays the whole source on the target, but for rounding."""
    length = max(np.abs(np.asarray(each.points)).max() for each in (source, target))
    return bool(result.fitness == 1 and result.inlier_rmse <= TOLERANCE * length)
