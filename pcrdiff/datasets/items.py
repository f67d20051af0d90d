"""What a data set's reader returns: items that are not yet loaded, and recorded pairs of them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float64, Num

from pcrdiff.clouds.surface import Cloud, Mesh, Oriented

RIGID_TOLERANCE = 5e-3
"""How far ``R R^T`` may lie from the identity, entry by entry.

Wide, because the field's own ground truth drifts: 5e-4 in 3DMatch's red kitchen.
"""


@dataclass(frozen=True)
class RawItem:
    """One mesh, fragment or scan of a data set; ``read`` loads it."""

    name: str
    """Unique in the data set: ``airplane_0001``, ``<scene>/cloud_bin_0``, ``00/000012``."""
    group: str
    """Category, scene or sequence."""
    split: Literal["train", "test"] | None
    """The data set's own split, where it has one."""
    read: Callable[[], "Mesh | Cloud | Oriented"]
    file: Path | None = None
    """What it is read from."""
    sha256: str | None = None
    """Digest of its own content, where the file holds other items too."""


@dataclass(frozen=True)
class RecordedPair:
    """Two items whose relative pose was measured."""

    source: str
    target: str
    T_target_source: Float64[np.ndarray, "4 4"]
    """Carries the source item into the target item's frame, in the data set's unit."""
    group: str


def check_rigid(matrix: Num[np.ndarray, "..."], where: str) -> Float64[np.ndarray, "4 4"]:
    """Refuse what is no rigid transform; else give it with its rounding removed.

    Poses on disk are rounded, so the rotation is replaced by the nearest exact one (by SVD).

    Args:
        matrix: What a file held: 4x4, translation in the last column.
        where: The file and the place in it, for the message.

    Raises:
        ValueError: Not 4x4 and finite, a last row other than ``0 0 0 1``, a reflection, or
            ``R R^T`` further than ``RIGID_TOLERANCE`` from the identity.
    """
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError(f"{where} needs a finite 4x4 pose, got {matrix.tolist()}")
    rotation = matrix[:3, :3].astype(np.float64)
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    last_row_error = float(np.abs(matrix[3] - np.array([0, 0, 0, 1])).max())
    if max(error, last_row_error) > RIGID_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ValueError(
            f"{where} needs a rigid pose, this one is off by {max(error, last_row_error):.2g} "
            f"(at most {RIGID_TOLERANCE}) with determinant {np.linalg.det(rotation):.3g}"
        )
    U, _, Vh = np.linalg.svd(rotation)
    rigid = np.eye(4)
    rigid[:3, :3], rigid[:3, 3] = U @ Vh, matrix[:3, 3]
    return rigid
