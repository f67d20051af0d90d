"""What runs in a child of :mod:`pcrdiff.bindings.isolation`; loads NumPy and the library."""

import kiss_matcher
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]
"""One row per point."""


def kiss_match(
    source: Points, target: Points, voxel_size: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], Points, Points]:
    """KISS-Matcher's rotation, translation, and the two sides of the matches that agree with them.

    The library reports the number that agree, not which: they are the nearest to each other.

    Its defaults but for the voxel size, of which every other length is a multiple: 3 for the
    radius of the normals, 5 for that of the features, 1 and 0.75 for the bounds on the noise. The
    clouds are not thinned out.
    """
    config = kiss_matcher.KISSMatcherConfig(voxel_size=voxel_size, use_voxel_sampling=False)
    matcher = kiss_matcher.KISSMatcher(config)
    answer = matcher.estimate(list(source), list(target))  # whole arrays crash it
    agreeing = matcher.get_num_final_inliers() if answer.valid else 0
    R, t = np.array(answer.rotation), np.array(answer.translation).reshape(3)
    p, q = (_rows(side) for side in matcher.get_keypoints_from_initial_matching())
    nearest = np.linalg.norm(p @ R.T + t - q, axis=1).argsort(kind="stable")[:agreeing]
    return R, t, p[nearest], q[nearest]


def _rows(points: list[Points]) -> Points:
    """A list of points, which may be empty, as an array."""
    return np.array(points, np.float32).reshape(-1, 3)
