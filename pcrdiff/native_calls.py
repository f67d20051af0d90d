"""What runs in a child of :mod:`pcrdiff.isolation`: it loads NumPy and one native library."""

import kiss_matcher
import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float32]
"""One point a row."""


def kiss_match(
    source: Points, target: Points, voxel_size: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """KISS-Matcher's rotation, translation, and number of matches that agree with them.

    Its defaults but for the voxels, which give every other length: 3 of them the radius of the
    normals, 5 that of the features, 1 and .75 the bounds on the noise. Nothing is thinned out.
    """
    config = kiss_matcher.KISSMatcherConfig(voxel_size=voxel_size, use_voxel_sampling=False)
    matcher = kiss_matcher.KISSMatcher(config)
    answer = matcher.estimate(list(source), list(target))  # of whole arrays it dies
    agreeing = matcher.get_num_final_inliers() if answer.valid else 0
    return np.array(answer.rotation), np.array(answer.translation), agreeing
