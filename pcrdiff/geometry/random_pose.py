"""The poses that pairs are made with."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.geometry.rotation import matrix_from_euler, matrix_from_quaternion


@dataclass(frozen=True)
class PoseRange:
    """The poses that are drawn from. Angles in radians, lengths in the cloud's unit."""

    max_rotation: float | None
    """Each Euler angle is uniform in [0, this]; None draws uniformly from all of SO(3)."""
    max_translation: float
    """Each coordinate is uniform in [``min_translation``, this]."""
    min_translation: float = 0.0


def draw_pose(poses: PoseRange, *, generator: np.random.Generator) -> Float64[np.ndarray, "4 4"]:
    """A random T_target_source; the paper's protocol (Sec. 4.1) is the range 45 degrees and 1."""
    if poses.max_rotation is None:  # a normal vector of four entries has no preferred direction
        R = matrix_from_quaternion(torch.from_numpy(generator.normal(size=4)))
    else:
        R = matrix_from_euler(torch.from_numpy(generator.uniform(0, poses.max_rotation, 3)))
    t = generator.uniform(poses.min_translation, poses.max_translation, 3)
    pose: Float64[np.ndarray, "4 4"] = from_parts(R, torch.from_numpy(t)).numpy()
    return pose
