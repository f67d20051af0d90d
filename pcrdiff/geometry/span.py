"""Whether points fix a pose: those on one line can be turned about it unseen."""

import numpy as np
from jaxtyping import Float

TOLERANCE = 1e-6
"""Width, as a share of the largest coordinate, below which points are one line; float32 has 6e-8."""


def spans_plane(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points lie on no line, nor in one place; coplanar ones do span a plane."""
    if len(points) < 3:
        return False
    values = np.asarray(points, np.float64)
    widths = np.linalg.svd(values - values.mean(axis=0), compute_uv=False) / np.sqrt(len(values))
    return bool(widths[1] > TOLERANCE * np.abs(values).max())
