"""Made-up cabinets: bookshelf, dresser, night_stand, tv_stand, wardrobe, glass_box."""

from itertools import pairwise

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    LEG_STYLES,
    bar_handle,
    carcass,
    drawer,
    drawers,
    knob,
    legs,
    mirrored,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
    block,
    join,
    lathe,
    move,
    rod,
    slab,
    turn,
)


def bookshelf(*, generator: np.random.Generator) -> Mesh:
    """Shelves in one to three columns, filled with books from one side."""
    draw = generator.uniform
    columns, rows = int(generator.integers(1, 4)), int(generator.integers(3, 7))
    width, depth, height = columns * draw(0.4, 0.7), draw(0.25, 0.36), rows * draw(0.28, 0.4)
    x, y, board = (-width / 2, width / 2), (-depth / 2, depth / 2), draw(0.015, 0.03)
    foot = draw(0.03, 0.1)
    edges, levels = (
        np.linspace(*x, columns + 1).tolist(),
        np.linspace(foot, height, rows + 1).tolist(),
    )
    parts = [carcass(x, y, (foot, height), board), block(x, (y[0] + 0.02, y[1]), (0, foot))]
    parts += [block((at, at + board), y, (foot, height)) for at in edges[1:-1]]
    parts += [block(x, y, (at, at + board)) for at in levels[1:-1]]
    for left, right in pairwise(edges):
        for low, high in pairwise(levels):
            if generator.random() < 0.75:
                room = (low + board, low + 0.92 * (high - low))
                parts.append(_books((left + board, right - board), y, room, generator=generator))
    return join(*parts)


def _books(x: Span, y: Span, z: Span, *, generator: np.random.Generator) -> Mesh:
    """A row of a few books from the left, the last one leaning."""
    count = int(generator.integers(2, 6))
    widths = generator.uniform(0.08, 0.15, count) * (x[1] - x[0])
    starts = x[0] + np.concatenate([[0], np.cumsum(widths)[:-1]])
    books = []
    for left, thick in zip(starts.tolist(), widths.tolist(), strict=True):
        top = z[0] + generator.uniform(0.65, 0.95) * (z[1] - z[0])
        front = y[0] + generator.uniform(0.05, 0.4) * (y[1] - y[0])
        books.append(block((left, left + 0.95 * thick), (front, y[1] - 0.03), (z[0], top)))
    books[-1] = turn(books[-1], "y", -12, about=(float(starts[-1]), 0, z[0]))
    return join(*books)


def dresser(*, generator: np.random.Generator) -> Mesh:
    """A chest of drawers in one to three columns, on feet, with a mirror or without."""
    draw = generator.uniform
    columns, rows = int(generator.integers(1, 4)), int(generator.integers(3, 6))
    width, depth, height = (
        0.25 + columns * draw(0.35, 0.5),
        draw(0.4, 0.55),
        rows * draw(0.17, 0.26),
    )
    x, y, foot = (-width / 2, width / 2), (-depth / 2, depth / 2), draw(0.05, 0.2)
    edges = np.linspace(*x, columns + 1).tolist()
    parts = [
        block(x, y, (foot, foot + height)),
        block(
            (x[0] - 0.03, x[1] + 0.03), (y[0] - 0.05, y[1]), (foot + height, foot + height + 0.03)
        ),
        legs(x, y, (0, foot), 0.06, LEG_STYLES[generator.integers(3)]),
    ]
    parts += [
        drawers((a, b), y[0], (foot, foot + height), rows, generator) for a, b in pairwise(edges)
    ]
    top = foot + height + 0.03
    if generator.random() < 0.4:
        parts += [
            block(
                (x[0] + 0.1, x[1] - 0.1),
                (y[1] - 0.04, y[1] - 0.02),
                (top + 0.05, top + draw(0.4, 0.9)),
            )
        ]
        parts += [
            block((s - 0.02, s + 0.02), (y[1] - 0.06, y[1]), (top, top + 0.4))
            for s in (x[0] + 0.1, x[1] - 0.1)
        ]
    open_one = drawer((edges[0], edges[1]), y[0] - draw(0.08, 0.2), (top - 0.2, top - 0.04), "bar")
    tray = block((edges[0] + 0.03, edges[1] - 0.03), (y[0] - 0.1, y[0]), (top - 0.18, top - 0.15))
    return join(*parts, open_one, tray)


def night_stand(*, generator: np.random.Generator) -> Mesh:
    """A small stand: drawers above, an open shelf below, seen from the front only."""
    draw = generator.uniform
    width, depth, height = draw(0.4, 0.6), draw(0.35, 0.45), draw(0.45, 0.65)
    x, y, board, foot = (
        (-width / 2, width / 2),
        (-depth / 2, depth / 2),
        draw(0.015, 0.03),
        draw(0.04, 0.25),
    )
    split = foot + draw(0.3, 0.6) * (height - foot)
    style = int(generator.integers(3))
    parts = [
        carcass(x, y, (foot, height), board),
        block((x[0] - 0.02, x[1] + 0.02), (y[0] - 0.03, y[1]), (height, height + 0.025)),
        block(x, y, (split, split + board)),
        block(x, (y[0] + 0.02, y[1]), (split, height)),
        drawers(x, y[0] + 0.02, (split, height), int(generator.integers(1, 3)), generator),
        legs(x, y, (0, foot), 0.05, LEG_STYLES[style]),
        block(x, (y[1] - 0.02, y[1]), (height, height + draw(0.06, 0.2))),
    ]
    if generator.random() < 0.5:  # a tray, pulled out above the drawers
        far = y[0] - draw(0.08, 0.25)
        parts.append(
            carcass((x[0] + 0.03, x[1] - 0.03), (far, y[0]), (height - 0.07, height), 0.01)
        )
    if generator.random() < 0.4:  # a door in front of the shelf, ajar
        door = join(
            block((x[0], x[1] - 0.02), (y[0] - 0.02, y[0]), (foot + board, split)),
            knob((x[1] - 0.06, y[0] - 0.02, (foot + split) / 2), 0.018),
        )
        parts.append(turn(door, "z", -draw(0, 60), about=(x[0], y[0], 0)))
    if generator.random() < 0.5:
        lamp_x = draw(-0.25, 0.25) * width
        light = lathe(
            [(0.07, 0), (0.07, 0.02), (0.015, 0.03), (0.015, 0.15), (0.1, 0.15), (0.06, 0.28)], 12
        )
        parts.append(move(light, (lamp_x, 0.05, height + 0.025)))
    return join(*parts)


def tv_stand(*, generator: np.random.Generator) -> Mesh:
    """A long low cabinet, drawers on one side, open shelves on the other; perhaps a set."""
    draw = generator.uniform
    width, depth, height, foot = draw(1.1, 2.0), draw(0.35, 0.5), draw(0.35, 0.6), draw(0.03, 0.15)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    split = x[0] + draw(0.3, 0.65) * width
    shelf = foot + draw(0.4, 0.6) * (height - foot)
    parts = [
        carcass(x, y, (foot, height), draw(0.02, 0.04)),
        block((x[0], split), (y[0] + 0.02, y[1]), (foot, height)),
        drawers(
            (x[0], split), y[0] + 0.02, (foot, height), int(generator.integers(1, 4)), generator
        ),
        block((split, x[1]), (y[0] + 0.04, y[1]), (shelf, shelf + 0.02)),
        legs(x, y, (0, foot), 0.05, LEG_STYLES[generator.integers(3)]),
    ]
    if generator.random() < 0.5:
        box_x = (split + 0.05, split + 0.7 * (x[1] - split))
        parts.append(block(box_x, (y[0] + 0.06, y[1] - 0.1), (shelf + 0.02, shelf + 0.08)))
    if generator.random() < 0.5:
        half, tall, at = draw(0.3, 0.45) * width, draw(0.4, 0.6), draw(-0.05, 0.05) * width
        parts += [
            block((at - half, at + half), (0.02, 0.06), (height + 0.07, height + 0.07 + tall)),
            block((at - 0.06, at + 0.06), (0.06, 0.09), (height, height + 0.4)),
            block((at - 0.2, at + 0.2), (-0.08, 0.14), (height, height + 0.02)),
        ]
    made = join(*parts)
    return made if generator.random() < 0.5 else mirrored(made)


def wardrobe(*, generator: np.random.Generator) -> Mesh:
    """A wardrobe: doors, one ajar, a drawer below or not, a crown, feet."""
    draw = generator.uniform
    doors = int(generator.integers(2, 5))
    width, depth, height = doors * draw(0.4, 0.55), draw(0.5, 0.65), draw(1.8, 2.3)
    x, y, foot = (-width / 2, width / 2), (-depth / 2, depth / 2), draw(0.04, 0.15)
    low = foot + (draw(0.25, 0.4) if generator.random() < 0.5 else 0.0)
    edges = np.linspace(*x, doors + 1).tolist()
    parts = [
        carcass(x, y, (foot, height), 0.03),
        block(
            (x[0] - 0.04, x[1] + 0.04),
            (y[0] - 0.05, y[1]),
            (height, height + draw(0.03, 0.1)),
            draw(0.95, 1.0),
        ),
        legs(x, y, (0, foot), 0.09, LEG_STYLES[generator.integers(2)]),
        rod((x[0], 0, height - 0.15), (x[1], 0, height - 0.15), 0.015),
    ]
    if low > foot:
        middle = (x[0] + x[1]) / 2
        parts.append(block(x, (y[0] + 0.01, y[1]), (foot, low)))
        parts += [
            drawer(span, y[0], (foot, low), "two knobs")
            for span in ((x[0], middle), (middle, x[1]))
        ]
    ajar = int(generator.integers(doors))
    for number, (left, right) in enumerate(pairwise(edges)):
        opening = draw(20, 90) if number == ajar else 0.0
        parts.append(_wardrobe_door((left, right), y[0], (low, height), opening, hinge=number % 2))
    return join(*parts)


def _wardrobe_door(x: Span, front: Real, z: Span, opening_deg: Real, hinge: int) -> Mesh:
    grip = (x[1] - 0.05, x[0] + 0.05)[hinge]
    middle = (z[0] + z[1]) / 2
    door = join(
        block((x[0] + 0.004, x[1] - 0.004), (front - 0.025, front), z),
        block(
            (x[0] + 0.08, x[1] - 0.08), (front - 0.035, front - 0.025), (z[0] + 0.1, middle - 0.05)
        ),
        block(
            (x[0] + 0.08, x[1] - 0.08), (front - 0.035, front - 0.025), (middle + 0.05, z[1] - 0.1)
        ),
        bar_handle(
            (grip, front - 0.025, middle - 0.08), (grip, front - 0.025, middle + 0.08), 0.008
        ),
    )
    return turn(door, "z", (-opening_deg, opening_deg)[hinge], about=(x[hinge], front, 0))


def glass_box(*, generator: np.random.Generator) -> Mesh:
    """A show case: thin panes in a frame on a plinth, its lid raised, a lock in front."""
    draw = generator.uniform
    width, depth, height = draw(0.3, 1.0), draw(0.25, 0.6), draw(0.2, 0.7)
    x, y, pane = (-width / 2, width / 2), (-depth / 2, depth / 2), 0.006
    slope = draw(0.55, 1.0)  # the front pane is lower than the back one
    plinth, low = draw(0.03, 0.15), slope * height
    side = [(y[0], plinth), (y[1], plinth), (y[1], plinth + height), (y[0], plinth + low)]
    lid_length = float(np.hypot(depth, height - low))
    lid = join(
        block(x, (-lid_length, 0), (0, pane)),
        *(block((at - 0.012, at + 0.012), (-lid_length, 0), (-0.005, 0.02)) for at in x),
    )
    rise = float(np.rad2deg(np.arctan2(height - low, depth)))
    parts = [
        block((x[0] - 0.02, x[1] + 0.02), (y[0] - 0.02, y[1] + 0.02), (0, plinth)),
        block(x, (y[0], y[0] + pane), (plinth, plinth + low)),
        block(x, (y[1] - pane, y[1]), (plinth, plinth + height)),
        move(turn(lid, "x", rise - draw(10, 70)), (0, y[1], plinth + height)),
        knob((draw(-0.2, 0.2) * width, y[0], plinth + 0.8 * low), 0.02),
    ]
    parts += [slab(side, (at, at + pane), "x") for at in (x[0], x[1] - pane)]
    parts += [
        rod((a, b, plinth), (a, b, plinth + h), 0.012)
        for a in x
        for b, h in ((y[0], low), (y[1], height))
    ]
    if generator.random() < 0.6:
        level = plinth + draw(0.3, 0.5) * low
        parts.append(block(x, (draw(-0.2, 0.2) * depth, y[1]), (level, level + pane)))
    if generator.random() < 0.6:
        show = lathe([(0.1, 0), (0.12, 0.1), (0.03, 0.3), (0.09, 0.5), (0.05, 0.6)], 12)
        parts.append(
            move(Mesh(show.vertices * low, show.faces), (draw(-0.3, -0.1) * width, 0, plinth))
        )
    return join(*parts)
