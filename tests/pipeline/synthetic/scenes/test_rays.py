"""Rays meet meshes where geometry says."""

import numpy as np
import pytest

from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.shapes.solids import boxes


def test_rays_report_distance_part_and_angle() -> None:
    scene = RayScene([boxes((2, 2, 2, 5, 0, -1)), boxes((0.1, 9, 0.1, 0, 0, 0))])
    hits = scene.cast(np.array([1.0, 0.5, 0.5]), np.array([[2.0, 0.0, 0.0], [0, 0, 1.0]]))
    np.testing.assert_allclose(hits.distance, [1.5, np.inf])
    assert hits.part.tolist() == [0, -1]
    assert hits.cosine[0] == pytest.approx(1.0)
    slanted = scene.cast(np.array([1.0, 0.0, 0.0]), np.array([[1.0, 0.2, 0.0]]))
    assert slanted.cosine[0] == pytest.approx(1 / np.hypot(1.0, 0.2))
