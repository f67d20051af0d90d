"""Open3D's registration in this project's terms: what several classical methods share."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.bindings.open3d import open3d
from pcrdiff.geometry.rigid import from_parts
from pcrdiff.geometry.span import TOLERANCE, spans_plane

registration = open3d.pipelines.registration

Pose = Float64[np.ndarray, "4 4"]
Points = Float[np.ndarray, "n 3"]


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


def check_support(who: str, source: Points, target: Points, wanted: str) -> None:
    """Refuse matches that fix no pose, so that what was fitted to them is no answer.

    Args:
        who: The method.
        source: The matched points of the one cloud.
        target: Their matches, row by row.
        wanted: What makes a match, for the sentence.

    Raises:
        ValueError: In one of the clouds they are fewer than three distinct points, or on a line.
    """
    if spans_plane(source) and spans_plane(target):
        return
    distinct = min(len(np.unique(points, axis=0)) for points in (source, target))
    if distinct < 3:
        raise ValueError(f"{who} needs 3 matches {wanted}, got {distinct}")
    raise ValueError(f"{who} needs 3 matches {wanted} on no line, got {len(source)} on one")


def check_matches(
    who: str,
    source: "open3d.geometry.PointCloud",
    target: "open3d.geometry.PointCloud",
    result: "open3d.pipelines.registration.RegistrationResult",
    max_distance: float,
) -> Pose:
    """The pose of Open3D's answer, unless its matches are such as :func:`check_support` refuses.

    Raises:
        ValueError: They are, or the pose is not rigid.
    """
    matches = np.asarray(result.correspondence_set).reshape(-1, 2)
    p, q = np.asarray(source.points)[matches[:, 0]], np.asarray(target.points)[matches[:, 1]]
    check_support(who, p, q, f"within {max_distance}")
    return check_pose(who, np.array(result.transformation))


def check_pose(who: str, pose: Pose) -> Pose:
    """The pose, if it is one.

    Raises:
        ValueError: It is not finite, or not rigid.
    """
    R = pose[:3, :3]
    rigid = np.abs(R @ R.T - np.eye(3)).max() <= TOLERANCE and np.linalg.det(R) > 0
    if not (rigid and np.isfinite(pose).all() and (pose[3] == np.eye(4)[3]).all()):
        raise ValueError(f"{who} needs a rigid pose from its library, got {pose.tolist()}")
    return pose


def icp(
    who: str,
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
        ValueError: No two points are within ``max_distance``, where Open3D would answer
            ``T_start``, or those that are fix no pose.
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
        raise ValueError(f"{who} needs points within {max_distance} of each other, got none")
    return check_matches(who, source, target, result, max_distance)


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
    who: str,
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
        who: The method that asks.
        source: The cloud that moves.
        target: The cloud that stays.
        max_distance: Of a match that supports a pose, in the clouds' unit.
        feature: Radius, greatest number of neighbours, and radius of the normals: see ``fpfh``.
        generator: What Open3D's own generator is seeded from.

    Raises:
        ValueError: Fewer than three matches of distinct points support the answer, or all of
            them lie on one line.
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
    return check_matches(who, p, q, result, max_distance)
