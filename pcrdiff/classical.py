"""Open3D's registration in this project's terms: what several classical methods share."""

import numpy as np
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.data.native import open3d

registration = open3d.pipelines.registration

Pose = Float64[np.ndarray, "4 4"]


def cloud(points: Float[Tensor, "n 3"]) -> "open3d.geometry.PointCloud":
    """An Open3D cloud; Open3D computes in float64."""
    vectors = open3d.utility.Vector3dVector(points.double().numpy())
    return open3d.geometry.PointCloud(vectors)


def icp(
    source: "open3d.geometry.PointCloud",
    target: "open3d.geometry.PointCloud",
    T_start: Pose,
    max_iterations: int,
    max_distance: float,
) -> Pose:
    """Point-to-point ICP (Besl & McKay 1992) from ``T_start``.

    ``max_distance`` between matched points is in the clouds' unit. Ends early where a round
    changes fitness and RMSE by less than Open3D's 1e-6.

    Raises:
        ValueError: No two points are within ``max_distance``; Open3D would answer ``T_start``.
    """
    result = registration.registration_icp(
        source,
        target,
        max_distance,
        T_start,
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(max_iteration=max_iterations),
    )
    if len(result.correspondence_set) == 0:
        raise ValueError(f"icp needs points within {max_distance} of each other, got none")
    return np.array(result.transformation)


def fpfh(
    points: "open3d.geometry.PointCloud", radius: float, max_neighbours: int, normal_radius: float
) -> "open3d.pipelines.registration.Feature":
    """Fast point feature histograms (Rusu et al. 2009).

    Normals are estimated from the points within ``normal_radius`` and turned away from the
    centroid, so that a moved cloud has moved normals. Both radii are in the cloud's unit.
    """
    points.estimate_normals(
        open3d.geometry.KDTreeSearchParamHybrid(radius=normal_radius, max_nn=30)
    )
    points.orient_normals_towards_camera_location(points.get_center())
    points.normals = open3d.utility.Vector3dVector(-np.asarray(points.normals))
    search = open3d.geometry.KDTreeSearchParamHybrid(radius=radius, max_nn=max_neighbours)
    # The stub has a third argument without the default that the binding gives it.
    return registration.compute_fpfh_feature(points, search)  # type: ignore[call-arg]
