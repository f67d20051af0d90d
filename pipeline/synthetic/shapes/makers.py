"""Who makes the shapes of each category of ModelNet40, and how much their sizes vary."""

from collections.abc import Callable
from functools import partial

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes import buildings, electronics, seating, vehicles, vessels
from pipeline.synthetic.shapes.cabinets import cabinet, glass_box
from pipeline.synthetic.shapes.solids import stretch

MAKERS: dict[str, tuple[Callable[[Draw], Mesh], tuple[float, float, float]]] = {
    "airplane": (vehicles.airplane, (0.1, 0.05, 0.2)),
    "bathtub": (buildings.bathtub, (0.15, 0.16, 0.15)),
    "bed": (seating.bed, (0.35, 0.08, 0.15)),
    "bench": (seating.bench, (0.28, 0.14, 0.1)),
    "bookshelf": (partial(cabinet, "bookshelf"), (0.25, 0.18, 0.2)),
    "bottle": (vessels.bottle, (0.25, 0.25, 0.3)),
    "bowl": (vessels.bowl, (0.2, 0.2, 0.4)),
    "car": (vehicles.car, (0.0, 0.0, 0.0)),
    "chair": (seating.chair, (0.18, 0.16, 0.11)),
    "cone": (vessels.cone, (0.3, 0.3, 0.35)),
    "cup": (vessels.cup, (0.2, 0.2, 0.3)),
    "curtain": (buildings.curtain, (0.3, 0.4, 0.3)),
    "desk": (seating.desk, (0.25, 0.2, 0.06)),
    "door": (buildings.door, (0.18, 0.2, 0.06)),
    "dresser": (partial(cabinet, "dresser"), (0.2, 0.12, 0.25)),
    "flower_pot": (vessels.flower_pot, (0.2, 0.2, 0.3)),
    "glass_box": (glass_box, (0.5, 0.4, 0.5)),
    "guitar": (electronics.guitar, (0.1, 0.1, 0.08)),
    "keyboard": (electronics.keyboard, (0.06, 0.06, 0.1)),
    "lamp": (vessels.lamp, (0.2, 0.2, 0.2)),
    "laptop": (electronics.laptop, (0.15, 0.14, 0.14)),
    "mantel": (buildings.mantel, (0.2, 0.25, 0.16)),
    "monitor": (electronics.monitor, (0.25, 0.1, 0.2)),
    "night_stand": (partial(cabinet, "night_stand"), (0.2, 0.12, 0.18)),
    "person": (vehicles.person, (0.12, 0.12, 0.06)),
    "piano": (electronics.piano, (0.07, 0.1, 0.06)),
    "plant": (vessels.plant, (0.15, 0.15, 0.2)),
    "radio": (electronics.radio, (0.35, 0.3, 0.3)),
    "range_hood": (buildings.range_hood, (0.28, 0.15, 0.15)),
    "sink": (buildings.sink, (0.15, 0.12, 0.1)),
    "sofa": (seating.sofa, (0.15, 0.12, 0.12)),
    "stairs": (buildings.stairs, (0.27, 0.14, 0.14)),
    "stool": (seating.stool, (0.14, 0.14, 0.28)),
    "table": (seating.table, (0.45, 0.28, 0.3)),
    "tent": (buildings.tent, (0.3, 0.3, 0.33)),
    "toilet": (buildings.toilet, (0.1, 0.12, 0.1)),
    "tv_stand": (partial(cabinet, "tv_stand"), (0.2, 0.18, 0.25)),
    "vase": (vessels.vase, (0.35, 0.35, 0.4)),
    "wardrobe": (partial(cabinet, "wardrobe"), (0.15, 0.13, 0.12)),
    "xbox": (electronics.xbox, (0.13, 0.15, 0.25)),
}
"""The maker, in metres; and by which share width, depth and height differ from what it makes."""


def make(category: str, draw: Draw) -> Mesh:
    """Make one object of a category in metres, z up, its front towards -y."""
    maker, spread = MAKERS[category]
    return stretch(maker(draw), [draw(1 - share, 1 + share) for share in spread])
