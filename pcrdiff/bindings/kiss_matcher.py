"""What runs in a child of :mod:`pcrdiff.bindings.isolation`: it loads NumPy and one native library."""

import kiss_matcher
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]
"""One point a row."""


def kiss_match(
    source: Points, target: Points, voxel_size: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], Points, Points]:
    """KISS-Matcher's rotation, translation, and the two sides of the matches that agree with them.

    The library tells how many agree, not which: they are those that lie nearest to each other.

    Its defaults but for the voxels, which give every other length: 3 of them the radius of the
    normals, 5 that of the features, 1 and .75 the bounds on the noise. Nothing is thinned out.
    """
    config = kiss_matcher.KISSMatcherConfig(voxel_size=voxel_size, use_voxel_sampling=False)
    matcher = kiss_matcher.KISSMatcher(config)
    answer = matcher.estimate(list(source), list(target))  # of whole arrays it dies
    agreeing = matcher.get_num_final_inliers() if answer.valid else 0
    R, t = np.array(answer.rotation), np.array(answer.translation).reshape(3)
    p, q = (_rows(side) for side in matcher.get_keypoints_from_initial_matching())
    nearest = np.linalg.norm(p @ R.T + t - q, axis=1).argsort(kind="stable")[:agreeing]
    return R, t, p[nearest], q[nearest]


def _rows(points: list[Points]) -> Points:
    """A list of points, be it empty, as an array."""
    return np.array(points, np.float32).reshape(-1, 3)
