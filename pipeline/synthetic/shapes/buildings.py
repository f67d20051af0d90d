"""What belongs to a house, and a tent.

bathtub, curtain, door, mantel, range_hood, sink, stairs, tent, toilet.
"""

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import carcass, knob, spaced, stand, tap
from pipeline.synthetic.shapes.solids import (
    Real,
    Row,
    arc,
    ball,
    both_sides,
    boxes,
    cushion,
    disc,
    four,
    join,
    lathe,
    loft,
    oval,
    place,
    rod,
    sheet,
    slab,
    smooth,
    stretch,
    tube,
    turn,
)


def curtain(draw: Draw) -> Mesh:
    """One or two pleated panels of unequal width on a rod; a panel may be tied back."""
    other = draw(0.22, 0.42)
    made = join(
        place(_pleats(draw(0.5, 0.85), draw), (-0.95, 0, 0)),
        rod((-1.05, 0, 2.05), (1.05, 0, 2.05), 0.018),
        both_sides(ball((0.05, 0.05, 0.05), (1.07, 0, 2.05), sides=8)),
        *draw.maybe(0.7, place(_pleats(other, draw), (0.95 - other, 0, 0))),
        *draw.maybe(0.4, boxes((1.9, 0.04, 0.26, 0, -0.08, 1.85))),
        boxes(*((0.04, 0.14, 0.06, x, 0.07, 2.02) for x in (-0.95, 0.95))),
    )
    return stretch(made, (draw.pick((-1, 1)), 1, 1))


def _pleats(width: Real, draw: Draw) -> Mesh:
    """A panel of cloth 2 m high, from x = 0 on."""
    waves, tie, strength = draw.whole(3, 6), draw(0.3, 0.5), draw.pick((0, 0, 0.6))
    u, v = np.meshgrid(np.linspace(0, 1, 6 * waves + 1), np.linspace(0, 1, 9), indexing="ij")
    gathered = 1 - strength * np.exp(-(((v - tie) / 0.2) ** 2))
    folds = 0.07 * np.sin(2 * np.pi * waves * u + 0.5 * np.sin(3 * v)) * (1.2 - 0.4 * v)
    surface = [width * u * gathered, folds * gathered, 2 - draw(1.88, 2) * (1 - v)]
    return sheet(np.stack(surface, axis=-1), (0, 0.008, 0))


def door(draw: Draw) -> Mesh:
    """A door ajar in its frame: panels or a window, lever handles, hinges on one side."""
    jamb, deep = draw(0.06, 0.14), draw(0.1, 0.2)
    window = [(0.5, 0.04, 0.46, z) for z in (1.04, 1.72)]
    window += [(0.04, 0.7, x, 1.04) for x in (0.23, 0.69)]
    faces = (  # what stands out on both sides, a kick plate first: width, height, x, z
        *([(0.82, 0.25, 0.46, 0.05)], window, [(0.7, 0.8, 0.46, z) for z in (0.16, 1.12)]),
        [(0.29, 0.52, x, z) for x in (0.26, 0.66) for z in (0.16, 0.8, 1.44)],
    )
    face = [(wide, 0.072, tall, x, 0, z) for wide, tall, x, z in draw.pick(faces)]
    lever = join(
        rod((0.85, 0.024, 1.02), (0.85, 0.084, 1.02), 0.015),
        rod((0.85, 0.084, 1.02), (0.72, 0.084, 1.02), 0.012),
        boxes((0.06, 0.012, 0.22, 0.85, 0.024, 0.9)),
    )
    leaf = join(boxes((0.92, 0.048, 2.07, 0.46, 0, 0.01), *face), lever, stretch(lever, (1, -1, 1)))
    posts = [(jamb, deep, 2.08 + jamb, x, deep / 2, 0) for x in (-jamb / 2, 0.92 + jamb / 2)]
    hinges = [rod((0, -0.024, z), (0, -0.024, z + 0.1), 0.015) for z in (0.2, 1.0, 1.75)]
    frame = boxes(*posts, (0.92, deep, jamb, 0.46, deep / 2, 2.08))
    made = join(turn(leaf, "z", -draw(5, 75)), frame, *hinges)
    return stretch(made, (draw.pick((-1, 1)), 1, 1))


def mantel(draw: Draw) -> Mesh:
    """A fireplace's surround: posts, lintel, stepped shelf, hearth, fire box and logs."""
    post, back, hearth = draw(0.15, 0.28), draw(0.25, 0.45), draw(0.2, 0.45)
    x, wide = 0.55 + post / 2, 1.1 + 2 * post
    rows: list[Row] = [
        (wide, 0.22, 0.25, 0, -0.11, 0.95),
        (wide + 0.1, 0.22 + hearth, 0.05, 0, -0.11 - hearth / 2, -0.05),
    ]
    for n in range(1, draw.whole(2, 4)):
        rows.append((wide + 0.06 * n, 0.22 + 0.03 * n, 0.04, 0, -0.11, 1.16 + 0.04 * n))
    for side in (-x, x):
        rows += [(post, 0.22, 0.95, side, -0.11, 0), (post + 0.04, 0.24, 0.12, side, -0.12, 0)]
    logs = [
        rod((draw(-0.45, -0.3), 0.05 + z, z), (draw(0.2, 0.45), 0.12, z), 0.05)
        for z in (0.09, 0.14, 0.19)[: draw.whole(1, 3)]
    ]
    return join(
        boxes(*rows),
        place(carcass(1.1, back, 0.95, 0.03), (0, back / 2, 0)),
        disc("y", 0.075, 0.03, (draw(-0.1, 0.1), -0.23, 1.07)),
        *draw.maybe(0.6, both_sides(rod((x, -0.22, 0), (x, -0.22, 0.95), 0.35 * post, 0.3 * post))),
        *logs,
    )


def stairs(draw: Draw) -> Mesh:
    """Stairs with a rail: straight, or with a landing and a corner."""
    count, side = draw.whole(6, 12), draw.pick((-1, 0, 0, 1))
    flight, top, end = _flight(count, draw), 0.175 * count, 0.28 * count
    if side == 0:
        return flight
    second = place(_flight(draw.whole(3, 6), draw), (side * 0.55, end + 0.55, top), -90 * side)
    landing = boxes((1.1, 1.1, 0.1, 0, end + 0.55, top - 0.1), (0.12, 0.12, top, 0, end + 1.04, 0))
    return join(flight, landing, second)


def _flight(count: int, draw: Draw) -> Mesh:
    """Steps up towards +y, massive or between beams, with a rail on the left, right or both."""
    end, top = 0.28 * count, 0.175 * count
    steps = [(0.28 * (n + 0.5), 0.175 * (n + 1)) for n in range(count)]
    massive = boxes(*((1.1, 0.3, z, 0, y, 0) for y, z in steps))
    beam = slab([(0, 0), (0.2, 0), (end, top - 0.1), (end, top)], (0.51, 0.55), "x")
    treads = boxes(*((1.1, 0.3, 0.05, 0, y, z - 0.05) for y, z in steps))
    posts = [rod((0.52, y, z), (0.52, y, z + 0.85), 0.015) for y, z in steps[::2]]
    right = join(rod((0.52, 0.14, 1.03), (0.52, steps[-1][0], top + 0.85), 0.03), *posts)
    rails = draw.pick((right, stretch(right, (-1, 1, 1)), both_sides(right)))
    return join(draw.pick((massive, join(treads, both_sides(beam)))), rails)


def tent(draw: Draw) -> Mesh:
    """A tent: ridge, dome, wigwam or tunnel, with a door flap, guy ropes and pegs."""
    hoops = [(2 * draw(0.85, 1), 1.3 * s, 0, 0, z) for s, z in ((2, 0), (1.98, 0.8), (1.8, 1.4))]
    pole = rod((0, 0, 1.8), (0.2, 0, 2.3), 0.02)
    bodies = (
        _ridge(draw),
        stretch(lathe(arc(1, 0, 90, 7), draw.pick((6, 8, 24))), (1, 1.3, 1.5)),
        join(
            lathe([(1.2, 0), (1.1, 0.1), (0.06, 1.95), (0.05, 1.95)], draw.whole(5, 9)),
            *(turn(pole, "z", angle) for angle in (0, 90, 200)),
        ),
        loft(hoops, draw(3, 6)),
    )
    flap = turn(slab([(0, 0), (0.6, 0), (0.3, 1.1)], (-0.02, 0), "y"), "z", draw(10, 40))
    rope = rod((0.5, 0.65, 0.6), (1.06, 1.38, 0), 0.008)
    peg = rod((1.06, 1.38, 0), (1.06, 1.38, 0.12), 0.015)
    return join(draw.pick(bodies), place(flap, (-0.3, -1.3, 0)), four(join(rope, peg)))


def _ridge(draw: Draw) -> Mesh:
    """Two sagging sheets, a gable, a ground sheet, two poles and a ridge pole."""
    s, t = np.meshgrid(np.linspace(-1.3, 1.3, 8), np.linspace(0, 1, 6), indexing="ij")
    sag = draw(0, 0.48) * t * (1 - t)
    side = sheet(np.stack([1 - t - sag, s, 1.5 * t - 0.3 * sag], axis=-1), (-0.015, 0, -0.01))
    gable = slab([(-1, 0), (1, 0), (0, 1.5)], (1.28, 1.3), "y")
    pole = tube([(0, -1.3, 0), (0, -1.3, 1.55), (0, 1.3, 1.55), (0, 1.3, 0)], 0.025)
    return join(both_sides(side), gable, pole, boxes((2, 2.6, 0.02, 0, 0, -0.01)))


def bathtub(draw: Draw) -> Mesh:
    """A bath: hollow tub, sloped at the far end, taps at the other; on feet, or walled in."""
    on_feet, wall, slope = draw.chance(0.35), draw(0.04, 0.1), draw(0.1, 0.3)
    taper, foot = (0.8, draw(0.08, 0.15)) if on_feet else (draw(0.9, 1.0), 0.0)
    outside = [(taper, foot), ((1 + taper) / 2, 0.27), (1, 0.52), (1.04, 0.54)]
    rows: list[Row] = [(1.65 * s, 0.78 * s, 0, 0, z) for s, z in outside]
    for share, shrink in ((1.0, 1.0), (0.6, 0.92), (0.25, 0.8), (0.2, 0.6)):
        shift, z = slope * (1 - share) / 2, foot + share * (0.54 - foot)
        inner = (shrink * (1.65 - 2 * wall) - 2 * shift, shrink * (0.78 - 2 * wall))
        rows.append((*inner, shift, 0, z))
    tub = loft(rows, draw(2.2, 7.0), 32)
    x, y, z = tub.vertices.T
    raised = z * (1 + draw(0.3, 0.6) * np.minimum(0, x / 0.825) ** 2)  # to lean against
    behind = boxes((1.72, draw(0.1, 0.3), draw(0.24, 0.64), 0, 0.45, 0))
    return join(
        Mesh(np.column_stack([x, y, raised]), tub.faces),
        place(tap(draw(0.12, 0.25), 0.18), (0.8, 0, 0.54), -90),
        *(disc("z", 0.025, 0.08, (0.825 - wall, y, 0.58), 10) for y in (-0.12, 0.12)),
        stand("round", 1.2, 0.5, foot + 0.08, 0.08) if on_feet else behind,
    )


def range_hood(draw: Draw) -> Mesh:
    """A kitchen's hood: canopy, chimney at the wall, buttons and lamps below."""
    rim, deep, flue, tall = draw(0.04, 0.12), draw(0.18, 0.28), draw(0.2, 0.36), draw(0.4, 0.9)
    shares, rise = draw.pick((((0, 1), 0.25), ((0, 0.55, 0.8, 1), 0.25), ((0.85, 0.95, 1), 0.08)))
    canopy, first = [], draw(-0.27, 0.08)
    for share, z in zip(shares, spaced(rim, rim + rise, len(shares)), strict=True):
        long = 0.48 + share * (deep - 0.48)
        canopy.append((0.78 + share * (flue - 0.78), long, 0, -long / 2, z))
    rows = [
        *((0.78, 0.015, rim, 0, y, 0) for y in (-0.473, -0.007)),
        *((0.015, 0.48, rim, x, -0.24, 0) for x in (-0.383, 0.383)),
        (0.78, 0.48, 0.01, 0, -0.24, 0.02),
        (flue, deep, tall, 0, -deep / 2, rim + rise),
        (flue + 0.02, deep + 0.01, 0.02, 0, -deep / 2, rim + rise + 0.5 * tall),
    ]
    return join(
        loft(canopy, squareness=30, sides=20),
        boxes(*rows),
        *(disc("y", 0.012, 0.012, (first + 0.035 * n, -0.48, rim / 2), 10) for n in range(4)),
        both_sides(disc("z", 0.04, 0.02, (0.23, -0.34, 0.01), 14)),
    )


def sink(draw: Draw) -> Mesh:
    """A sink: one basin on a pedestal, or one or two in a counter; a tap behind."""
    if draw.chance(0.4):
        foot = lathe(smooth([(0.16, 0), (0.1, 0.1), (0.08, 0.4), (0.14, 0.68)], 10))
        ledge = boxes((0.5, 0.08, draw(0.14, 0.24), 0, 0.21, 0.69))
        basin = place(_basin(0.55, 0.2, draw(2.0, 5.0)), (0, 0, 0.63))
        return join(basin, foot, ledge, place(tap(draw(0.15, 0.3), 0.16), (0, 0.21, 0.83)))
    wide, tall, square = draw(0.35, 0.55), draw(0.15, 0.3), draw(4, 9)
    second = draw.pick((0, draw(0.2, 0.35)))
    board = [(0.38, 0.48, 0.01, -0.19, 0, tall - 0.02)]  # ribbed, to drain on
    board += [(0.01, 0.38, 0.01, x, 0, tall - 0.01) for x in spaced(-0.32, -0.06, 5)]
    parts = [
        place(_basin(wide, tall, square), (wide / 2, 0, 0)),
        boxes((wide + second, 0.1, 0.035, (wide + second) / 2, 0.28, tall - 0.03)),
        place(tap(draw(0.2, 0.4), 0.22), (draw(0.35, 0.65) * (wide + second), 0.28, tall)),
        *draw.maybe(0.6, boxes(*board)),
    ]
    if second:
        at = (wide + second / 2, 0, 0.3 * tall)
        parts.append(place(_basin(second, 0.7 * tall, square), at))
    return join(*parts)


def _basin(width: Real, height: Real, square: Real) -> Mesh:
    """A hollow basin on z = 0, over its waste pipe."""
    shape = [(0.7, 0.0), (0.92, 0.6), (1, 1), (0.88, 1), (0.8, 0.5), (0.6, 0.15), (0.1, 0.12)]
    basin = loft([(s * width, 0.48 * s, 0, 0, z * height) for s, z in shape], square, 28)
    return join(basin, rod((0, 0, -0.12), (0, 0, 0), 0.03))


def toilet(draw: Draw) -> Mesh:
    """A toilet: foot, hollow bowl, seat, lid up or down, tank with lever."""
    low, tall, wide, deep = draw(0.4, 0.46), draw(0.32, 0.38), draw(0.34, 0.44), draw(0.18, 0.24)
    shape = [  # width and depth; y and z of the middle
        *((0.23, 0.36, 0.05, 0), (0.19, 0.29, 0.05, 0.14), (0.36, 0.46, 0, 0.34)),
        *((0.38, 0.48, 0, 0.4), (0.3, 0.4, 0, 0.4), (0.27, 0.36, 0, 0.32), (0.1, 0.2, 0.05, 0.2)),
    ]
    ring = oval(0.35, 0.45, (0, 0, 0.41))
    lid = loft([(0.38, 0.48, 0, -0.23, z) for z in (-0.012, 0.012)])
    lid = turn(lid, "x", draw.pick((0, -draw(85, 100))))
    y, grip = 0.2 + deep / 2, draw.pick((-1, 1)) * (wide / 2 - 0.06)
    return join(
        loft([(w, d, 0, shift, z) for w, d, shift, z in shape], 2.4),
        tube(np.vstack([ring, ring[:2]]), 0.022, sides=6),
        place(lid, (0, 0.23, 0.44)),
        cushion((wide, deep, tall), (0, y, low), 7),
        boxes(
            (wide + 0.03, deep + 0.015, 0.03, 0, y, low + tall),
            (0.23, deep + 0.04, low - 0.18, 0, y - 0.02, 0.2),
            (0.1, 0.02, 0.02, 0.7 * grip, 0.17, low + tall - 0.08),
        ),
        knob((grip, 0.2, low + tall - 0.06), 0.015),
    )
