"""How hard each test pair is, and the bins of pairs of similar difficulty."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
import torch
from jaxtyping import Float64
from scipy.spatial import cKDTree

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.registration import Pairs
from pipeline.reporting.paper import UNSEEN_OBJECTS
from pipeline.reporting.reading import PairFile

PARTIAL = "modelnet40-partial"
ROTATION, OVERLAP = "rotation_deg", "overlap"
WIDTHS = {ROTATION: 15.0, OVERLAP: 0.1}
"""Of a bin; an angle in degrees, an overlap as a share of the source points."""
LARGEST = {ROTATION: 180.0, OVERLAP: 1.0}
REACH = 0.05
"""How far a moved source point may be from a target point that it overlaps with."""


def measure_difficulty(files: Mapping[str, PairFile]) -> pd.DataFrame:
    """Measure the test pairs: the true angle on unseen objects, the overlap on partial clouds.

    Returns:
        A row for each pair of these scenarios: ``scenario``, ``pair``, ``by`` (``rotation_deg`` or
        ``overlap``), and the bin that it falls in, ``bin_low`` to ``bin_high``.
    """
    measures = [(UNSEEN_OBJECTS, ROTATION, rotation_deg), (PARTIAL, OVERLAP, overlap)]
    frames = [
        bin_pairs(scenario, by, measure(files[scenario].test))
        for scenario, by, measure in measures
        if scenario in files
    ]
    return pd.concat([bin_pairs("", ROTATION, np.array([])), *frames], ignore_index=True)


def bin_pairs(scenario: str, by: str, values: Float64[np.ndarray, " pairs"]) -> pd.DataFrame:
    """Say which bin each pair's value falls in; the largest value belongs to the last bin."""
    last = round(LARGEST[by] / WIDTHS[by]) - 1
    number = np.minimum(np.floor(values / WIDTHS[by] + 1e-9), last)
    edges = {"bin_low": number * WIDTHS[by], "bin_high": (number + 1) * WIDTHS[by]}
    return pd.DataFrame({"pair": np.arange(len(values)), **edges}).assign(scenario=scenario, by=by)


def rotation_deg(pairs: Pairs) -> Float64[np.ndarray, " pairs"]:
    """Give the angle of each true rotation in degrees."""
    still = torch.eye(4, dtype=torch.float64).expand(len(pairs), 4, 4)
    angles: Float64[np.ndarray, " pairs"] = error_r_deg(pairs.T_target_source, still).numpy()
    return angles


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
