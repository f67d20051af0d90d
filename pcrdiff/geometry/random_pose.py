"""The poses that pairs are made with."""

import numpy as np
import torch
from jaxtyping import Float64

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.geometry.rotation import matrix_from_euler


def draw_pose(
    max_rotation: float, max_translation: float, *, generator: np.random.Generator
) -> Float64[np.ndarray, "4 4"]:
    """A random T_target_source, by the paper's protocol (Sec. 4.1).

    Args:
        max_rotation: Each Euler angle is uniform in [0, this], in radians.
        max_translation: Each coordinate is uniform in [0, this], in the cloud's unit.
        generator: Source of randomness.
    """
    angles = torch.from_numpy(generator.uniform(0, max_rotation, 3))
    translation = torch.from_numpy(generator.uniform(0, max_translation, 3))
    pose: Float64[np.ndarray, "4 4"] = from_parts(matrix_from_euler(angles), translation).numpy()
    return pose
