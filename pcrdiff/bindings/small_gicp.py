"""small_gicp (Koide 2024) in this project's terms: clouds as surfaces, and fine registration of two."""

from typing import Any, Literal

import numpy as np
import small_gicp
from jaxtyping import Float64

Points = Float64[np.ndarray, "n 3"]
Pose = Float64[np.ndarray, "4 4"]
NEIGHBOURS = 10  # the library's default


class Surface:
    """A cloud with its search tree, and the spread of each point's 10 nearest."""

    def __init__(self, points: Points) -> None:
        """``points`` near the origin: the library turns clouds about it."""
        self.points = points
        self.cloud = small_gicp.PointCloud(points)
        self.tree = small_gicp.KdTree(self.cloud)
        small_gicp.estimate_covariances(self.cloud, self.tree, num_neighbors=NEIGHBOURS)


def align(
    source: Surface,
    target: Surface,
    T_start: Pose,
    kind: Literal["GICP", "ICP"],
    max_distance: float,
    max_iterations: int,
) -> Any:  # noqa: ANN401  the library's RegistrationResult
    """Refine T_target_source by generalized or by point-to-point ICP, on one thread.

    Ends early once a round turns by less than 0.1 degrees and moves by less than 0.001.
    """
    return small_gicp.align(
        target.cloud,
        source.cloud,
        target.tree,
        init_T_target_source=T_start,
        registration_type=kind,
        max_correspondence_distance=max_distance,
        max_iterations=max_iterations,
        num_threads=1,
    )
