"""Cabinets stand on feet, carry their fronts before the body, and differ from draw to draw."""

import numpy as np
import pytest

from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.cabinets import CABINETS, cabinet


@pytest.mark.parametrize("category", CABINETS)
@pytest.mark.parametrize("seed", range(4))
def test_a_cabinet_has_the_size_that_its_kind_says(category: str, seed: int) -> None:
    kind = CABINETS[category]
    wide, depth, height, feet = kind.size
    vertices = cabinet(category, Draw(np.random.default_rng(seed))).vertices
    width = np.ptp(vertices[:, 0])
    assert kind.columns[0] * wide <= width <= (kind.columns[1] + 1) * wide + 0.25
    assert vertices[:, 2].min() == pytest.approx(0, abs=0.01)
    assert vertices[:, 2].max() >= height + feet + 0.03 - 1e-9
    assert vertices[:, 1].max() < depth / 2 + 0.03


@pytest.mark.parametrize("category", sorted(set(CABINETS) - {"bookshelf"}))
def test_fronts_stand_before_the_body(category: str) -> None:
    _, depth, _, _ = CABINETS[category].size
    vertices = cabinet(category, Draw(np.random.default_rng(3))).vertices
    assert vertices[:, 1].min() < -depth / 2 - 0.02


@pytest.mark.parametrize("category", CABINETS)
def test_cabinets_of_a_kind_differ(category: str) -> None:
    shapes = {
        cabinet(category, Draw(np.random.default_rng(seed))).vertices.tobytes() for seed in range(6)
    }
    assert len(shapes) == 6


def test_the_layout_of_a_column_fills_its_height() -> None:
    for category, kind in CABINETS.items():
        for layout in kind.layouts:
            for column in layout:
                assert sum(share for _, share in column) == pytest.approx(1), category
