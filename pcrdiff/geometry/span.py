"""Whether points fix a pose: a turn about the line that they all lie on leaves no trace."""

import numpy as np
from jaxtyping import Float

TOLERANCE = 1e-6
"""Least width off a line, as a share of the largest coordinate; float32 resolves 6e-8."""


def spans_plane(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points lie on no line, nor in one place; coplanar ones do span a plane."""
    if len(points) < 3:
        return False
    values = np.asarray(points, np.float64)
    widths = np.linalg.svd(values - values.mean(axis=0), compute_uv=False) / np.sqrt(len(values))
    return bool(widths[1] > TOLERANCE * np.abs(values).max())


def check_support(
    who: str, source: Float[np.ndarray, "n 3"], target: Float[np.ndarray, "n 3"], wanted: str
) -> None:
    """Refuse matches that fix no pose: what was fitted to them is no answer.

    Args:
        who: The method.
        source: The matched points of one cloud.
        target: Their matches, row by row.
        wanted: What makes a match, for the error message.

    Raises:
        ValueError: In one of the clouds they are fewer than three distinct points, or on a line.
    """
    if spans_plane(source) and spans_plane(target):
        return
    distinct = min(len(np.unique(points, axis=0)) for points in (source, target))
    if distinct < 3:
        raise ValueError(f"{who} needs 3 matches {wanted}, got {distinct}")
    raise ValueError(f"{who} needs 3 matches {wanted} on no line, got {len(source)} on one")
