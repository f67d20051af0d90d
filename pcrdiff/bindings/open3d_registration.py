"""Open3D's registration in this project's terms: what several classical methods share."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.bindings.open3d import open3d
from pcrdiff.geometry.neighbors import nearest_by_distances
from pcrdiff.geometry.rigid import check_pose
from pcrdiff.geometry.span import check_support

registration = open3d.pipelines.registration

Source = Float[Tensor, "n 3"]
Target = Float[Tensor, "m 3"]
Pose = Float64[Tensor, "4 4"]


def cloud(points: Float[Tensor, "n 3"]) -> "open3d.geometry.PointCloud":
    """An Open3D cloud; Open3D computes in float64."""
    vectors = open3d.utility.Vector3dVector(points.double().numpy())
    return open3d.geometry.PointCloud(vectors)


@contextmanager
def one_thread() -> Iterator[None]:
    """Hold Open3D to one thread, because its result depends on thread scheduling."""
    open3d.utility.set_max_threads(1)
    try:
        yield
    finally:
        open3d.utility.set_max_threads(0)  # as many as there are processors


def check_matches(
    who: str,
    source: "open3d.geometry.PointCloud",
    target: "open3d.geometry.PointCloud",
    result: "open3d.pipelines.registration.RegistrationResult",
    max_distance: float,
) -> Pose:
    """The pose of Open3D's answer, whose matches are at most ``max_distance`` apart.

    Raises:
        ValueError: The matches fix no pose, or the pose is not rigid.
    """
    matches = np.asarray(result.correspondence_set).reshape(-1, 2)
    p, q = np.asarray(source.points)[matches[:, 0]], np.asarray(target.points)[matches[:, 1]]
    check_support(who, p, q, f"within {max_distance}")
    return check_pose(who, np.array(result.transformation))


@dataclass(frozen=True)
class PointToPoint:
    """Point-to-point ICP (Besl & McKay 1992)."""

    max_iterations: int
    max_distance: float
    """Between matched points, in the clouds' unit."""

    def refine(self, who: str, source: Source, target: Target, T_start: Pose) -> Pose:
        """Refine ``T_start``.

        Ends early where a round changes fitness and RMSE by less than Open3D's 1e-6.

        Raises:
            ValueError: No two points are within ``max_distance``, where Open3D would answer
                ``T_start``, or those that are fix no pose.
        """
        p, q = cloud(source), cloud(target)
        result = registration.registration_icp(
            p,
            q,
            self.max_distance,
            T_start.numpy(),
            registration.TransformationEstimationPointToPoint(),
            registration.ICPConvergenceCriteria(max_iteration=self.max_iterations),
        )
        if len(result.correspondence_set) == 0:
            raise ValueError(
                f"{who} needs points within {self.max_distance} of each other, got none"
            )
        return check_matches(who, p, q, result, self.max_distance)


@dataclass(frozen=True)
class FeatureMatching:
    """Matching of fast point feature histograms (Rusu et al. 2009); lengths in the clouds' unit."""

    max_distance: float
    """Of a match that supports a pose."""
    feature_radius: float
    feature_neighbours: int
    """The greatest number of points within ``feature_radius`` that a feature is computed from."""
    normal_radius: float

    def fpfh(self, points: "open3d.geometry.PointCloud") -> "open3d.pipelines.registration.Feature":
        """The features of a cloud, which gets normals on the way.

        Normals are estimated from the points within ``normal_radius`` and turned away from the
        centroid, so that a moved cloud has moved normals.
        """
        hybrid = open3d.geometry.KDTreeSearchParamHybrid
        points.estimate_normals(hybrid(radius=self.normal_radius, max_nn=30))
        points.orient_normals_towards_camera_location(points.get_center())
        points.normals = open3d.utility.Vector3dVector(-np.asarray(points.normals))
        search = hybrid(radius=self.feature_radius, max_nn=self.feature_neighbours)
        # The stub has a third argument without the default that the binding gives it.
        return registration.compute_fpfh_feature(points, search)  # type: ignore[call-arg]

    def match(
        self, source: Source, target: Target, *, mutual: bool = False
    ) -> tuple[Float64[Tensor, "matches 3"], Float64[Tensor, "matches 3"]]:
        """The points of the source, and those of the target whose features are nearest to theirs.

        ``mutual`` keeps a match only if the source's feature is the nearest to the target's, too.
        """
        p, q = (
            torch.tensor(np.asarray(self.fpfh(cloud(points)).data).T).unsqueeze(0)
            for points in (source, target)
        )
        chosen, rows = nearest_by_distances(p, q, 1)[1].flatten(), torch.arange(len(source))
        if mutual:
            rows = rows[nearest_by_distances(q, p, 1)[1].flatten()[chosen] == rows]
        return source[rows].double(), target[chosen[rows]].double()

    def ransac(
        self, who: str, source: Source, target: Target, *, generator: torch.Generator
    ) -> Pose:
        """RANSAC over mutual FPFH matches (Fischler & Bolles 1981; Rusu et al. 2009).

        The generator decides which matches are tried. Open3D's documented settings: three matches
        a trial, whose edges differ by at most a tenth and which lie within ``max_distance`` of
        each other once moved; up to 100,000 trials, fewer once the best pose is the right one
        with a confidence of 0.999.

        Raises:
            ValueError: Fewer than three matches of distinct points support the answer, or all of
                them lie on one line.
        """
        seed_open3d(generator)
        p, q = cloud(source), cloud(target)
        with one_thread():
            result = registration.registration_ransac_based_on_feature_matching(
                p,
                q,
                self.fpfh(p),
                self.fpfh(q),
                mutual_filter=True,
                max_correspondence_distance=self.max_distance,
                ransac_n=3,
                checkers=[
                    registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                    registration.CorrespondenceCheckerBasedOnDistance(self.max_distance),
                ],
                criteria=registration.RANSACConvergenceCriteria(100_000, 0.999),
            )
        return check_matches(who, p, q, result, self.max_distance)


def seed_open3d(generator: torch.Generator) -> None:
    """Seed Open3D's own generator."""
    open3d.utility.random.seed(int(torch.randint(2**31 - 1, (), generator=generator)))
