"""Objects are made in metres, upright, facing -y; the same generator makes the same one."""

import numpy as np
import pytest
from jaxtyping import Float64

from pcrdiff.clouds.surface import Mesh, sample_points
from pcrdiff.datasets.modelnet40 import CATEGORIES
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.makers import make

SIZES = {  # the least and the greatest of width, depth and height, in metres
    "airplane": (15, 45),
    "bottle": (0.04, 0.5),
    "bowl": (0.03, 0.4),
    "car": (1, 5.5),
    "chair": (0.3, 1.6),
    "cup": (0.04, 0.25),
    "desk": (0.5, 2.2),
    "door": (0.2, 2.6),
    "guitar": (0.04, 1.3),
    "keyboard": (0.02, 0.6),
    "laptop": (0.15, 0.6),
    "person": (0.3, 2.2),
    "piano": (0.4, 2.6),
    "sofa": (0.5, 4),
    "wardrobe": (0.5, 2.8),
}


def made(category: str, seed: int) -> Mesh:
    return make(category, Draw(np.random.default_rng(seed)))


def extent(mesh: Mesh) -> Float64[np.ndarray, "3"]:
    return np.asarray(np.ptp(mesh.vertices, axis=0))


@pytest.mark.parametrize("category", SIZES)
def test_objects_have_their_size_in_metres(category: str) -> None:
    sizes = np.stack([extent(made(category, seed)) for seed in range(5)])
    assert sizes.max() < SIZES[category][1]
    if category != "airplane":  # which is flat
        assert sizes.min() > SIZES[category][0]
    assert sizes.max(axis=1).min() > SIZES[category][1] / 3


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_same_generator_makes_the_same_object(category: str) -> None:
    first, again, other = made(category, 1), made(category, 1), made(category, 2)
    assert np.array_equal(first.vertices, again.vertices)
    assert np.array_equal(first.faces, again.faces)
    assert not np.array_equal(extent(first), extent(other))


@pytest.mark.parametrize("category", ["chair", "sofa", "toilet", "laptop", "bed", "stool"])
def test_what_leans_or_rises_behind_has_its_front_towards_minus_y(category: str) -> None:
    for seed in range(3):
        mesh = made(category, seed)
        points = sample_points(mesh, 2000, generator=np.random.default_rng(0))
        high = points[:, 2] > points[:, 2].min() + 0.6 * extent(mesh)[2]
        assert points[high, 1].mean() > points[~high, 1].mean()
