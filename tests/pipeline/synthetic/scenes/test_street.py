"""Streets bend gently, leave the lane free and show every material."""

import numpy as np
import pytest

from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.scenes.street import Material, foliage, sample_road, sample_street

LENGTH = 150.0


@pytest.mark.parametrize("seed", range(5))
def test_bends_and_slopes_keep_their_promise(seed: int) -> None:
    road, joins = sample_road(LENGTH, generator=np.random.default_rng(seed))
    np.testing.assert_allclose(np.hypot(np.diff(road.x), np.diff(road.y)), np.diff(road.s))
    assert np.abs(np.diff(road.heading)).max() < 1 / 45
    assert np.abs(np.diff(road.z)).max() < 0.06
    assert joins
    assert road.kerb.max() == pytest.approx(0.13)
    assert road.kerb.min() == 0.0


def test_left_of_the_road_is_left_of_its_heading() -> None:
    road, _ = sample_road(LENGTH, generator=np.random.default_rng(0))
    x, y, _, heading = road.at(50.0)
    left_x, left_y, _, _ = road.at(50.0, 2.0)
    forward, aside = np.array([np.cos(heading), np.sin(heading)]), [left_x - x, left_y - y]
    assert float(np.cross([*forward, 0.0], [*aside, 0.0])[2]) == pytest.approx(2.0)


@pytest.mark.parametrize("seed", range(3))
def test_nothing_stands_in_the_lane(seed: int) -> None:
    road, parts = sample_street(LENGTH, generator=np.random.default_rng(seed))
    rays = RayScene([mesh for _, mesh in parts])
    angles = np.linspace(0.0, 2 * np.pi, 60)
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(60)])
    for s in np.arange(10.0, LENGTH - 10.0, 5.0):
        x, y, z, _ = road.at(float(s), -1.5)
        for height in (0.5, 1.0, 1.73):
            assert rays.cast(np.array([x, y, z + height]), around).distance.min() > 1.0


def test_every_material_is_somewhere_and_none_is_unknown() -> None:
    seen = set()
    for seed in range(3):
        _, parts = sample_street(LENGTH, generator=np.random.default_rng(seed))
        seen |= {material for material, _ in parts}
    assert seen == set(Material)


def test_leaves_stay_in_their_crown_and_let_some_rays_through() -> None:
    crown = foliage((2.0, 1.0, 1.5), 200, 0.1, generator=np.random.default_rng(0))
    lower, upper = crown.vertices.min(axis=0), crown.vertices.max(axis=0)
    assert (lower > [-2.3, -1.3, -0.3]).all()
    assert (upper < [2.3, 1.3, 3.3]).all()
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(1.0, 2.0, 40))
    directions = np.column_stack([np.full(1600, 8.0), y.reshape(-1), z.reshape(-1) - 1.5])
    met = RayScene([crown]).cast(np.array([-8.0, 0.0, 1.5]), directions).part == 0
    assert 0.05 < met.mean() < 0.95
