"""Open3D's registration in this project's terms: what several classical methods share."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.data.native import open3d
from pcrdiff.geometry.rigid import from_parts

registration = open3d.pipelines.registration

Pose = Float64[np.ndarray, "4 4"]


def cloud(points: Float[Tensor, "n 3"]) -> "open3d.geometry.PointCloud":
    """An Open3D cloud; Open3D computes in float64."""
    vectors = open3d.utility.Vector3dVector(points.double().numpy())
    return open3d.geometry.PointCloud(vectors)


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold Open3D to one thread, where its answer would hang on which thread is first."""
    open3d.utility.set_max_threads(1)
    try:
        yield
    finally:
        open3d.utility.set_max_threads(0)  # as many as there are processors


def centroid_shift(
    source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
) -> Float64[np.ndarray, "batch 4 4"]:
    """The pose that lays the source's centroid on the target's and turns nothing."""
    shift = (target.mean(dim=-2) - source.mean(dim=-2)).double()
    return from_parts(torch.eye(3).to(shift).repeat(len(shift), 1, 1), shift).numpy()


def centred(points: Float[Tensor, "n 3"]) -> tuple[Float64[Tensor, "n 3"], Float64[Tensor, "4 4"]]:
    """The cloud about its own centroid, and the pose that carries it back."""
    mean = points.double().mean(dim=0)
    return points.double() - mean, from_parts(torch.eye(3).to(mean), mean)


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


def ransac_fpfh(
    source: Float[Tensor, "n 3"],
    target: Float[Tensor, "m 3"],
    max_distance: float,
    feature: tuple[float, int, float],
    *,
    generator: torch.Generator,
) -> Pose:
    """RANSAC over mutual FPFH matches (Fischler & Bolles 1981; Rusu et al. 2009).

    The generator decides which matches are tried. Open3D's documented settings: three matches a
    trial, whose edges differ by at most a tenth and which lie within ``max_distance`` of each
    other once moved; up to 100,000 trials, fewer once the best pose is at 0.999 the right one.

    Args:
        source: The cloud that moves.
        target: The cloud that stays.
        max_distance: Of a match that supports a pose, in the clouds' unit.
        feature: Radius, greatest number of neighbours, and radius of the normals: see ``fpfh``.
        generator: What Open3D's own generator is seeded from.

    Raises:
        ValueError: Fewer than three matches support the answer.
    """
    open3d.utility.random.seed(int(torch.randint(2**31 - 1, (), generator=generator)))
    p, q = cloud(source), cloud(target)
    with one_thread():
        result = registration.registration_ransac_based_on_feature_matching(
            p,
            q,
            fpfh(p, *feature),
            fpfh(q, *feature),
            mutual_filter=True,
            max_correspondence_distance=max_distance,
            ransac_n=3,
            checkers=[
                registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                registration.CorrespondenceCheckerBasedOnDistance(max_distance),
            ],
            criteria=registration.RANSACConvergenceCriteria(100_000, 0.999),
        )
    matches = len(result.correspondence_set)
    if matches < 3:
        raise ValueError(f"ransac_fpfh needs 3 matches within {max_distance}, got {matches}")
    return np.array(result.transformation)
