"""Things with keys, strings or a screen: guitar, keyboard, laptop, monitor, piano, radio, xbox."""

from collections.abc import Sequence

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import knob, stand
from pipeline.synthetic.shapes.solids import (
    Real,
    Row,
    Span,
    arc,
    both_sides,
    boxes,
    cushion,
    disc,
    join,
    lathe,
    loft,
    place,
    rod,
    slab,
    smooth,
    tube,
    turn,
)

SPACE_ROW = ((0, 1.5), (1.5, 1.5), (3.2, 6.3), (9.7, 1.3), (12, 1), (13, 1), (14, 1))
"""The keys of the row in front: left edge and width, in keys."""
SHIFTS = (0.5, 0.75, 0.25, 0, 0)
"""By how much the rows behind it stand to the right, in keys."""


def _keys(keys: Sequence[Row], pitch: Span, high: Real) -> Mesh:
    """Keys on z = 0, each from its row, left edge and width; pitch of the keys and of the rows."""
    (row, left, wide), (across, along), gap = np.array(keys, dtype=np.float64).T, pitch, 0.0024
    size = [wide * across - gap, np.full(len(keys), along - gap), np.full(len(keys), high)]
    rows = np.column_stack([*size, (left + wide / 2) * across, (row + 0.5) * along, 0 * row])
    return boxes(*rows.tolist(), taper=(0.8, 0.8))


def keyboard(draw: Draw) -> Mesh:
    """A keyboard: a sloped board, rows of keys, space bar, arrows, a pad of numbers or not."""
    rows, pad, pitch = draw.whole(5, 6), draw.whole(0, 4), 0.0185
    keys: list[Row] = [(0, left, wide) for left, wide in SPACE_ROW]
    for row, shift in enumerate(SHIFTS[: rows - 1], start=1):
        keys += [(row, shift + n, 1) for n in range(13 + (row > 2))]
        keys += [(row, 15.6 + n, 1) for n in range(pad)]
    width, depth = (15 + (pad + 0.6 if pad else 0)) * pitch, rows * pitch
    made = join(
        cushion((width + 0.02, depth + 0.02, 0.014), (width / 2, depth / 2, -0.014), 9),
        _keys(keys, (pitch, pitch), draw(0.004, 0.011)),
        boxes(*((0.03, 0.01, 0.016, at * width, depth, -0.03) for at in (0.1, 0.85))),
        *draw.maybe(0.35, cushion((width, 0.065, 0.012), (width / 2, -0.04, -0.014), 7)),
    )
    return turn(made, "x", draw(2, 9))


def laptop(draw: Draw) -> Mesh:
    """A laptop, opened: keys, touch pad, hinges, screen."""
    columns, thick, near = draw.whole(11, 14), draw(0.012, 0.028), draw(0.095, 0.11)
    keys = [(row, n, 1) for row in range(5) for n in range(columns) if row or not 3 <= n < 8]
    board = _keys([*keys, (0, 3, 5)], (0.31 / columns, (0.205 - near) / 5), 0.004)
    screen = boxes((0.345, 0.008, 0.235, 0, 0.004, 0), (0.325, 0.002, 0.21, 0, -0.001, 0.015))
    return join(
        cushion((0.345, 0.235, thick), (0, 0.118, 0), 10),
        place(board, (-0.155, near, thick)),
        boxes((0.1, 0.065, 0.002, -0.003, 0.048, thick)),
        place(turn(screen, "x", -draw(-5, 45)), (0, 0.235, thick)),
        both_sides(rod((0.14, 0.235, thick), (0.09, 0.235, thick), 0.007)),
    )


def monitor(draw: Draw) -> Mesh:
    """A monitor: a flat screen on a foot, or a deep tube; bezel, buttons."""
    lift, y, tall = draw(0.06, 0.16), draw(0.04, 0.09), draw(0.29, 0.46)
    deep = draw.pick((draw(0.25, 0.4), draw(0.03, 0.08), draw(0.03, 0.08)))
    shell = [(0.96, 0.01), (0.9, 0.4 * deep), (0.5, deep)]
    casing = loft([(0.58 * s, tall * s, 0, -tall / 2, back) for s, back in shell], 8, 20)
    rows = [
        (0.58, 0.03, tall, 0, -0.005, 0),
        *((0.58, 0.01, high, 0, -0.025, z) for high, z in ((0.03, 0), (0.02, tall - 0.02))),
        *((0.02, 0.01, tall, x, -0.025, 0) for x in (-0.28, 0.28)),
        *((0.016, 0.008, 0.016, x, -0.034, 0.01) for x in (0.18, 0.21, 0.24)),
    ]
    screen = turn(join(turn(casing, "x", -90), boxes(*rows)), "x", -draw(-2, 12))
    feet = (
        loft([(0.35, 0.24, 0, y, z) for z in (-0.01, 0.01)]),
        boxes((0.29, 0.2, 0.02, 0, y, -0.01)),
        both_sides(rod((0, y, 0.01), (0.2, y - 0.14, 0), 0.015)),
    )
    neck = rod((0, y + 0.01, 0.01), (0, 0.03, lift + 0.12), draw(0.02, 0.04))
    return join(place(screen, (0, 0, lift)), neck, draw.pick(feet))


def xbox(draw: Draw) -> Mesh:
    """A game console, lying or standing, with disc slot, vents, plugs; its controller in front."""
    waist, squareness = draw.pick(((1.0, 9), (0.9, 5), (0.95, 12)))
    shell = [(0.98, 0), (1, 0.007), (waist, 0.035), (1, 0.063), (0.98, 0.07)]
    rows = [
        (0.15, 0.03, 0.007, -0.045, -0.12, 0.042),
        *((0.02, 0.03, 0.007, x, -0.12, 0.014) for x in (-0.01, 0.02, 0.05, 0.11)),
        *((0.02, 0.016, 0.02, x, 0.13, 0.02) for x in (-0.09, -0.05, 0.03)),
        *((0.01, 0.08, 0.006, x, 0.065, 0.07) for x in (-0.115, -0.085, -0.055, -0.025)),
    ]
    case = loft([(0.3 * s, 0.26 * s, 0, 0, z) for s, z in shell], squareness, 28)
    lying = join(case, boxes(*rows), disc("z", 0.05, 0.012, (0.045, -0.026, 0.07)))
    standing = place(turn(lying, "y", -90), (0, 0, 0.15))
    grip = tube([(0.05, 0, 0.03), (0.08, -0.05, 0.02), (0.07, -0.09, 0.015)], [0.03, 0.023, 0.015])
    knobs = ((-0.04, 0.012), (0.02, -0.015), (0.04, 0.02), (0.055, 0.005))
    pad = join(
        cushion((0.15, 0.08, 0.037), (0, 0, 0.01), 3),
        both_sides(grip),
        *(rod((x, y, 0.04), (x, y, 0.06), 0.01) for x, y in knobs),
    )
    at = (draw(-0.1, 0.12), draw(-0.29, -0.23), 0)
    return join(draw.pick((lying, lying, standing)), place(pad, at, draw(-40, 40)))


ACOUSTIC = ((0, 0), (0.7, 0.03), (1, 0.25), (0.68, 0.58), (0.72, 0.85), (0.35, 1), (0, 0.97))
ELECTRIC = ((0, 0), (0.7, 0.03), (1, 0.25), (0.68, 0.58), (0.85, 1), (0.4, 0.85), (0, 0.97))
HORNED = ((0.3, 0.82), (0.8, 1.18), (0.68, 0.58), (1, 0.25), (0.7, 0.03))
"""Outlines of guitars: half the width and the height of each knot; the last the left of one."""


def guitar(draw: Draw) -> Mesh:
    """A guitar that stands upright, strings to -y: acoustic, or electric with horns."""
    electric, top = draw.chance(0.5), draw(0.8, 0.9)
    y = -(draw(0.017, 0.025) if electric else draw(0.04, 0.06))
    right, left = (ELECTRIC, HORNED) if electric else (ACOUSTIC, ACOUSTIC[-2:0:-1])
    knots = np.array([*right, *((-x, z) for x, z in left), (0, 0)]) * [0.19, 0.47]
    pegs = [(0.045, 0.014, 0.014, 0.05, y, top + z) for z in (0.03, 0.075, 0.12)]
    rows = [
        (0.05, 0.035, top - 0.35, 0, y, 0.35),
        (0.07, 0.02, 0.17, 0, y, top),
        (0.18, 0.012, 0.033, 0, y - 0.006, 0.09),
        *((0.002, 0.002, top - 0.11, x, y - 0.018, 0.11) for x in (-0.015, -0.005, 0.005, 0.015)),
    ]
    if electric:  # pick-ups
        rows += [(0.09, 0.012, 0.035, 0, y - 0.006, z) for z in (0.1, 0.19, 0.28)]
    guard = slab([(0.05, 0.19), (0.12, 0.21), (0.06, 0.29)], (y - 0.006, y), "y")
    details = [guard] if electric else [guard, disc("y", 0.05, 0.008, (0, y, 0.29))]
    heads = boxes(*pegs) if electric else both_sides(boxes(*pegs))
    return join(slab(smooth(knots, 44)[:-1], (y, -y), "y"), boxes(*rows), heads, *details)


def piano(draw: Draw) -> Mesh:
    """A piano: upright, or grand with its lid raised; white and black keys, pedals."""
    length, height, deep = draw(1.1, 1.9), draw(1.05, 1.35), draw(0.3, 0.5)
    keys = [(0.032, 0.16, 0.02, 0.036 * k, -0.08, 0.74) for k in range(-17, 18)]
    sharps = [k + 0.5 for k in range(-17, 17) if k % 7 not in (1, 4)]
    keyboard = boxes(
        *keys,
        *((0.02, 0.1, 0.012, 0.036 * k, -0.05, 0.76) for k in sharps),
        (1.4, 0.2, 0.1, 0, -0.08, 0.65),
        *((0.05, 0.28, 0.14, x, -0.04, 0.7) for x in (-0.675, 0.675)),
        *((0.024, 0.2, 0.02, x, 0, 0.06) for x in (-0.1, 0, 0.1)),
    )
    upright = boxes(
        (1.4, deep, height, 0, deep / 2, 0),
        (1.44, deep + 0.02, 0.03, 0, deep / 2, height),
        (0.7, 0.02, 0.2, 0, -0.02, 0.82),
        *((0.1, 0.18, 0.65, x, -0.09, 0) for x in (-0.65, 0.65)),
    )
    wing = [(0.7, 0), (0.7, 0.35), (0.25, 0.65), (0.07, 0.95), (-0.35, 1), (-0.7, 0.9)]
    outline = np.vstack([smooth(wing), [[-0.7, 0]]]) * [1, length]
    feet = ((-0.58, 0.1), (0.58, 0.1), (-0.28, 0.85 * length))
    grand = join(
        slab(outline, (0.62, 0.9)),
        turn(slab(outline, (0.9, 0.92)), "y", -draw(20, 40), (-0.7, 0, 0.9)),
        rod((0.6, 0.3 * length, 0.9), (0.2, 0.3 * length, 1.2), 0.012),
        boxes((0.26, 0.04, 0.6, 0, 0.14, 0.02), (0.6, 0.02, 0.2, 0, 0.11, 0.9)),
        *(rod((x, y, 0), (x, y, 0.62), 0.04, 0.06) for x, y in feet),
    )
    return join(keyboard, draw.pick((upright, grand)))


def radio(draw: Draw) -> Mesh:
    """A radio: one speaker or two, a dial, knobs, a handle or an arched case, an aerial."""
    style, size = draw.whole(0, 2), draw(0.06, 0.085)
    profile = [(1, 0), (1, 0.02), (0.85, 0.02), (0.3, 0.005), (0.2, 0.015)]
    speaker = turn(lathe([(r * size, z) for r, z in profile]), "x", 90)
    speaker = place(speaker, (1.12 * size - 0.18, -0.052, 0.1))
    if style == 2:  # an arched case, as of old
        crown, top = arc(1, 0, 180, 14) * [0.18, 0.08] + [0, 0.21], 0.29
        case = slab([*crown, (-0.18, 0.01), (0.18, 0.01)], (-0.052, 0.052), "y")
    else:
        loop = [(-0.145, 0, 0.19), (-0.145, 0, 0.25), (0.145, 0, 0.25), (0.145, 0, 0.19)]
        case, top = join(cushion((0.36, 0.104, 0.2), (0, 0, 0.01), 8), tube(loop, 0.01)), 0.21
    wide, x = (0.16, 0.08) if style == 0 else (0.11, 0.0)
    marks = [(0.02, 0.01, 0.015, x + left, -0.057, 0.105) for left in (-0.03, 0, 0.03)]
    tip = (0.12 + draw(-0.06, 0.17), 0.03, top + draw(0.17, 0.34))
    return join(
        case,
        speaker if style == 0 else both_sides(speaker),
        boxes((wide, 0.008, 0.048, x, -0.056, 0.13), *marks),
        *(knob((x + left, -0.052, 0.065), draw(0.015, 0.03)) for left in (-0.036, 0.036)),
        rod((0.12, 0.03, 0.8 * top), tip, 0.006, 0.003),
        stand("round", 0.28, 0.08, 0.01, 0.02),
    )
