"""How hard each test pair is, and the pairs of like difficulty."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from pcrdiff.registration import Pairs
from pipeline.reporting.background import PairFile
from pipeline.reporting.paper import UNSEEN_OBJECTS

PARTIAL = "modelnet40-partial"
ROTATION, OVERLAP = "rotation_deg", "overlap"
WIDTHS = {ROTATION: 15.0, OVERLAP: 0.1}
"""Of a bin; an angle in degrees, an overlap as a share of the source points."""
REACH = 0.05
"""How far a moved source point may be from a target point that it overlaps with."""
FEWEST = 5
"""Pairs in a bin; one with fewer has no rows."""


@dataclass(frozen=True)
class Difficulty:
    """One measure of how hard the test pairs of a scenario are."""

    scenario: str
    name: str
    """``rotation_deg`` or ``overlap``."""
    values: Float64[np.ndarray, " pairs"]

    def bins(self, pair: Int64[np.ndarray, " chosen"]) -> dict[str, Int64[np.ndarray, " inside"]]:
        """Sort pairs into bins: by ``<name>=<low>-<high>``, the places in ``pair``."""
        width = WIDTHS[self.name]
        last = {ROTATION: 180.0, OVERLAP: 1.0}[self.name] / width - 1
        number = np.minimum(np.floor(self.values[pair] / width + 1e-9), round(last))
        found = {
            f"{self.name}={low * width:g}-{(low + 1) * width:g}": np.flatnonzero(number == low)
            for low in np.unique(number)
        }
        return {name: inside for name, inside in found.items() if len(inside) >= FEWEST}


def measure_difficulties(files: Mapping[str, PairFile]) -> list[Difficulty]:
    """Measure the test pairs: the true angle on unseen objects, the overlap on partial clouds."""
    measures: dict[str, tuple[str, Callable[[Pairs], Float64[np.ndarray, " pairs"]]]] = {
        UNSEEN_OBJECTS: (ROTATION, rotation_deg),
        PARTIAL: (OVERLAP, overlap),
    }
    return [
        Difficulty(scenario, name, measure(files[scenario].test))
        for scenario, (name, measure) in measures.items()
        if scenario in files
    ]


def rotation_deg(pairs: Pairs) -> Float64[np.ndarray, " pairs"]:
    """Give the angle of each true rotation in degrees."""
    R = pairs.T_target_source[:, :3, :3].double().numpy()
    cosine = (np.trace(R, axis1=1, axis2=2) - 1) / 2
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def overlap(pairs: Pairs) -> Float64[np.ndarray, " pairs"]:
    """Give the share of source points that, truly moved, have a target point within ``REACH``."""
    shares = []
    for source, target, pose in zip(
        pairs.source.double().numpy(),
        pairs.target.double().numpy(),
        pairs.T_target_source.double().numpy(),
        strict=True,
    ):
        distance, _ = cKDTree(target).query(source @ pose[:3, :3].T + pose[:3, 3])
        shares.append(float(np.mean(distance <= REACH)))
    return np.array(shares)
