"""Cabinets: one carcass, with columns of shelves, drawers and doors; and the glass box."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import LEGS, carcass, drawers, handle, knob, stand
from pipeline.synthetic.shapes.solids import (
    Real,
    Row,
    both_sides,
    boxes,
    join,
    lathe,
    place,
    rod,
    slab,
    stretch,
    turn,
)

Column = tuple[tuple[Callable[[Real, Real, Real, Draw], Mesh], Real], ...]
"""What fills a column, from below: who makes it for a width, depth and height; its share."""


def _books(width: Real, depth: Real, height: Real, draw: Draw) -> Mesh:
    """Shelves, most of them with a row of books from the left, the last one leaning."""
    rows, parts = round(height / draw(0.27, 0.38)), []
    each = height / rows
    for z in np.linspace(0, height, rows, endpoint=False).tolist():
        parts.append(boxes((0.02, depth, each, width / 2, 0, z), (width, depth, 0.02, 0, 0, z)))
        if z == 0 or draw.chance(0.75):
            count = draw.whole(3, 6)
            thick = draw.generator.uniform(0.08, 0.15, count) * width
            left = np.cumsum(thick) - thick / 2 - 0.47 * width
            size = draw.generator.uniform((0.6, 0.6), (0.95, 0.9), (count, 2)) * [depth, each]
            behind, floor = (depth - size[:, 0]) / 2 - 0.02, np.full(count, z)
            books = np.column_stack([0.95 * thick, size, left, behind, floor]).tolist()
            leaning = turn(boxes(books[-1]), "y", -12, about=(left[-1], 0, z))
            parts += [boxes(*books[:-1]), leaning]
    return join(*parts)


def _drawers(width: Real, depth: Real, height: Real, draw: Draw) -> Mesh:
    front = drawers(width, height, max(1, round(height / draw(0.15, 0.26))), draw)
    return place(front, (0, -depth / 2, 0))


def _door(width: Real, depth: Real, height: Real, draw: Draw) -> Mesh:
    """A door with two panels and a handle, ajar now and then."""
    side = draw.pick((-1, 1))
    grip, panel = side * (width / 2 - 0.05), (0.7 * width, 0.01, 0.4 * height, 0, -0.03)
    door = join(
        boxes((width - 0.008, 0.025, height - 0.01, 0, -0.0125, 0.005)),
        boxes((*panel, 0.06 * height), (*panel, 0.54 * height)),
        handle((grip, -0.025, 0.42 * height), (grip, -0.025, 0.58 * height)),
    )
    opening = side * draw(10, 70) if draw.chance(0.4) else 0
    return place(turn(door, "z", opening, about=(-side * width / 2, 0, 0)), (0, -depth / 2, 0))


def _open(width: Real, depth: Real, height: Real, draw: Draw) -> Mesh:
    """A shelf with a box on it, which stands to the left."""
    level = draw(0.35, 0.5) * height
    box = (0.5 * width, 0.7 * depth, 0.4 * (height - level), -0.15 * width, 0, level)
    return boxes((width, depth, 0.02, 0, 0, level), box)


BOOKS: Column = ((_books, 1),)
DRAWERS: Column = ((_drawers, 1),)
DOOR: Column = ((_door, 1),)
OPEN: Column = ((_open, 1),)
DRAWERS_AND_DOOR: Column = ((_drawers, 0.16), (_door, 0.84))
OPEN_AND_DRAWERS: Column = ((_open, 0.5), (_drawers, 0.5))
DOOR_AND_DRAWERS: Column = ((_door, 0.6), (_drawers, 0.4))
TWO_DOORS: Column = ((_door, 0.45), (_door, 0.55))

# What stands on cabinets: boxes, in shares of their width and depth; heights in metres.
MIRROR = ((0.8, 0.04, 0.65, 0, 0.42, 0.05), *((0.06, 0.12, 0.4, x, 0.42, 0) for x in (-0.4, 0.4)))
TELEVISION = (
    (0.75, 0.09, 0.5, 0, 0.1, 0.07),
    (0.1, 0.07, 0.4, 0, 0.18, 0),
    (0.3, 0.5, 0.02, 0, 0.07, 0),
)
CROWN = ((1.06, 1.08, 0.06, 0, -0.04, 0), (0.3, 0.6, 0.16, -0.15, 0, 0.06))
LEDGE = ((1, 0.05, 0.12, 0, 0.475, 0), (0.35, 0.5, 0.1, -0.2, 0, 0), (0.2, 0.3, 0.25, 0.3, 0.2, 0))
WORKTOP = (  # with a stove and a tap, and wall cabinets over it
    (1.01, 1.07, 0.04, 0, -0.03, 0),
    (0.24, 0.7, 0.3, -0.3, 0.1, 0.04),
    (0.02, 0.06, 0.28, 0.1, 0.3, 0),
    (0.015, 0.35, 0.03, 0.1, 0.15, 0.27),
    (0.7, 0.6, 0.65, 0, 0.2, 0.56),
    *((0.2, 0.04, 0.6, x, -0.12, 0.58) for x in (-0.22, 0, 0.22)),
)


@dataclass(frozen=True)
class Cabinet:
    """What the cabinets of a kind have in common."""

    layouts: tuple[tuple[Column, ...], ...]
    """One is drawn: its columns from one end to the other, the last of them repeated."""
    columns: tuple[int, int]
    """From, to."""
    size: tuple[Real, Real, Real, Real]
    """Width of a column, depth, height without feet, feet; in metres."""
    top: tuple[Row, ...] = ()
    """What stands on half of them."""


CABINETS = {
    "bookshelf": Cabinet(((BOOKS,),), (1, 3), (0.55, 0.3, 1.6, 0.06)),
    "counter": Cabinet(((DOOR,),), (4, 4), (0.53, 0.58, 0.8, 0.05), WORKTOP),
    "dresser": Cabinet(((DRAWERS,),), (1, 3), (0.5, 0.45, 0.85, 0.12), MIRROR),
    "fridge": Cabinet(((TWO_DOORS,),), (1, 1), (0.6, 0.6, 1.7, 0.03)),
    "night_stand": Cabinet(
        ((OPEN_AND_DRAWERS,), (DOOR_AND_DRAWERS,)), (1, 1), (0.5, 0.4, 0.45, 0.15), LEDGE
    ),
    "tv_stand": Cabinet(
        ((DRAWERS, OPEN), (OPEN, DRAWERS, DOOR)), (2, 3), (0.6, 0.42, 0.45, 0.09), TELEVISION
    ),
    "wardrobe": Cabinet(((DOOR,), (DRAWERS_AND_DOOR,)), (2, 4), (0.48, 0.57, 1.95, 0.09), CROWN),
}


def cabinet(category: str, draw: Draw) -> Mesh:
    """A cabinet of one of ``CABINETS``, as its layout has it or the other way round."""
    kind = CABINETS[category]
    (wide, depth, height, foot), count = kind.size, draw.whole(*kind.columns)
    width, layout = count * wide, draw.pick(kind.layouts)
    parts = [
        place(carcass(width, depth, height, 0.02), (0, 0, foot)),
        stand(draw.pick(LEGS), width, depth, foot, 0.06),
        boxes((width + 0.04, depth + 0.03, 0.03, 0, -0.015, foot + height)),
    ]
    for number in range(count):
        z = foot
        for fill, share in layout[min(number, len(layout) - 1)]:
            at = ((number + 0.5) * wide - width / 2, 0, z)
            parts.append(place(fill(wide, depth, share * height, draw), at))
            z += share * height
    if kind.top and draw.chance(0.5):
        on_top = stretch(boxes(*kind.top), (width, depth, draw(0.8, 1.2)))
        parts.append(place(on_top, (0, 0, foot + height + 0.03)))
    return stretch(join(*parts), (draw.pick((-1, 1)), 1, 1))


def glass_box(draw: Draw) -> Mesh:
    """A show case: thin panes in a frame on a plinth, its lid raised, a lock in front."""
    low, plinth, level = draw(0.55, 1) * 0.45, draw(0.03, 0.15), draw(0.25, 0.4)
    slope, rise = float(np.hypot(0.42, 0.45 - low)), float(np.rad2deg(np.arctan2(0.45 - low, 0.42)))
    posts = [rod((0.32, y, 0), (0.32, y, h), 0.012) for y, h in ((-0.21, low), (0.21, 0.45))]
    side = slab([(-0.21, 0), (0.21, 0), (0.21, 0.45), (-0.21, low)], (0.314, 0.32), "x")
    bars = [(0.024, slope, 0.025, x, -slope / 2, -0.005) for x in (-0.32, 0.32)]
    lid = boxes((0.64, slope, 0.006, 0, -slope / 2, 0), *bars)
    panes = [(0.64, 0.006, low, 0, -0.21, 0), (0.64, 0.006, 0.45, 0, 0.21, 0)]
    vase = lathe([(0.1, 0), (0.12, 0.1), (0.03, 0.3), (0.09, 0.5), (0.05, 0.6)], 12)
    return join(
        boxes(*panes, (0.64, level, 0.006, 0, 0.21 - level / 2, 0.4 * low)),
        both_sides(join(side, *posts)),
        place(turn(lid, "x", rise - draw(10, 70)), (0, 0.21, 0.45)),
        knob((draw(-0.13, 0.13), -0.21, 0.8 * low), 0.02),
        boxes((0.68, 0.46, plinth, 0, 0, -plinth)),
        *draw.maybe(0.6, place(stretch(vase, (low, low, low)), (draw(-0.2, -0.05), 0, 0))),
    )
