"""A synthetic ModelNet40: CAD-like shapes of its 40 categories in the official folders and files."""

from pathlib import Path

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pcrdiff.datasets.modelnet40 import CATEGORIES, SYMMETRIC
from pcrdiff.loops import Progress, silent
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.makers import MAKERS, make
from pipeline.synthetic.shapes.solids import stretch

_UNITS_PER_METRE = (1.0, 39.37, 100.0, 1000.0)  # metres, inches, centimetres, millimetres


def make_shape(category: str, *, generator: np.random.Generator) -> Mesh:
    """Make one shape of a category, z up, its front towards -y.

    As in ModelNet the unit is each category's own, and the origin is somewhere near the shape.
    Unlike there, bowls and vases are oval: a body of revolution has no pose that a method could
    be held to.

    Raises:
        ValueError: ModelNet40 has no such category.
    """
    if category not in MAKERS:
        raise ValueError(f"make_shape needs a category of ModelNet40, got {category!r}")
    mesh = make(category, Draw(generator))
    if category in SYMMETRIC:
        mesh = stretch(mesh, (generator.uniform(1.4, 1.7), 1, 1))
    unit = _UNITS_PER_METRE[CATEGORIES.index(category) % len(_UNITS_PER_METRE)]
    size = unit * generator.uniform(0.8, 1.25)
    offset = size * np.ptp(mesh.vertices, axis=0).max() * generator.uniform(-0.5, 0.5, 3)
    return Mesh(size * mesh.vertices + offset, mesh.faces)


def write_modelnet40(
    root: Path,
    *,
    train_per_category: int,
    test_per_category: int,
    seed: int,
    progress: Progress = silent,
) -> None:
    """Write ``<root>/<category>/{train,test}/<category>_NNNN.off`` for all 40 categories.

    Numbers run on from train into test, as in the official set. A shape depends on ``seed``, its
    category and its number only; the same call writes the same bytes.

    Raises:
        ValueError: There would be no training or no test shape.
    """
    if train_per_category < 1 or test_per_category < 1:
        raise ValueError(
            "write_modelnet40 needs at least one training and one test shape a category, "
            f"got {train_per_category} and {test_per_category}"
        )
    numbers = range(1, train_per_category + test_per_category + 1)
    shapes = [(place, name, number) for place, name in enumerate(CATEGORIES) for number in numbers]
    for place, category, number in progress(shapes, "modelnet40"):
        split = "train" if number <= train_per_category else "test"
        path = root / category / split / f"{category}_{number:04d}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        generator = np.random.default_rng([seed, place, number])
        path.write_text(_off(make_shape(category, generator=generator)), encoding="ascii")


def _off(mesh: Mesh) -> str:
    """The text of an OFF file, six digits a coordinate."""
    points = [f"{x:.6g} {y:.6g} {z:.6g}" for x, y, z in mesh.vertices.tolist()]
    faces = [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    return "\n".join(["OFF", f"{len(points)} {len(faces)} 0", *points, *faces, ""])
