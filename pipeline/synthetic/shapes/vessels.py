"""Things turned on a wheel, and what grows in them.

bottle, bowl, cone, cup, flower_pot, lamp, plant, vase.
"""

import numpy as np
from jaxtyping import Float64

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import leaf
from pipeline.synthetic.shapes.solids import (
    Real,
    arc,
    ball,
    both_sides,
    boxes,
    disc,
    hollow,
    join,
    lathe,
    place,
    rod,
    smooth,
    stretch,
    tube,
    turn,
)

Knots = tuple[tuple[Real, Real, Real, Real], ...]
"""Of an outline, from below: radius from, to; height from, to."""
BOTTLE: Knots = (
    *((0.031, 0.045, 0, 0), (0.045, 0.045, 0.016, 0.016), (0.038, 0.05, 0.05, 0.09)),
    *((0.045, 0.045, 0.1, 0.18), (0.011, 0.02, 0.21, 0.235), (0.013, 0.018, 0.26, 0.26)),
)
CUP: Knots = ((0.024, 0.04, 0, 0), (0.03, 0.044, 0.04, 0.04), (0.04, 0.04, 0.09, 0.09))
LAMP: Knots = (
    *((0.012, 0.012, 0, 0), (0.012, 0.1, 0.12, 0.12), (0.012, 0.05, 0.24, 0.24)),
    (0.012, 0.012, 0.4, 0.4),
)
VASE: Knots = (
    *((0.04, 0.08, 0, 0), (0.075, 0.115, 0.07, 0.12), (0.055, 0.105, 0.17, 0.23)),
    *((0.024, 0.048, 0.26, 0.3), (0.038, 0.085, 0.35, 0.35)),
)


def _outline(knots: Knots, draw: Draw) -> Float64[np.ndarray, "20 2"]:
    return smooth([(draw(inner, outer), draw(low, high)) for inner, outer, low, high in knots])


def bottle(draw: Draw) -> Mesh:
    """A bottle or flask: body, shoulder, neck, lip, cap; round or flattened."""
    neck = draw(0.018, 0.024)
    made = join(
        lathe(_outline(BOTTLE, draw)),
        disc("z", neck, 0.009, (0, 0, 0.255)),
        *draw.maybe(0.5, disc("z", 1.1 * neck, draw(0.01, 0.025), (0, 0, 0.266), 16)),
        *draw.maybe(0.5, disc("z", 0.048, draw(0.03, 0.07), (0, 0, 0.065))),  # a label
    )
    return stretch(made, (1, draw.pick((1, 1, 1, draw(0.55, 0.8))), 1))


def bowl(draw: Draw) -> Mesh:
    """A bowl, deep or shallow, on a foot or not, its rim straight or turned out."""
    s, foot, raised = np.linspace(0, 1, 14), draw(0.3, 0.6), draw(0.005, 0.02)
    outline = np.column_stack([foot + (1 - foot) * s ** draw(0.3, 0.8), s**1.3])
    outline[-1, 0] *= draw(0.9, 1.15)
    ring = lathe([(0.1 * foot, -raised), (0.09 * foot, 0.01)], 32)
    return join(hollow(outline * [0.11, 0.07], 0.007, 0.009, sides=32), *draw.maybe(0.7, ring))


def cone(draw: Draw) -> Mesh:
    """A cone: of the road, with a square foot and bands; bare; or upside down, for ice cream."""
    outline = np.linspace((0.2, 0), (draw(0.005, 0.04), 0.6), 10)
    wide, rim = draw(0.46, 0.6), draw(0.2, 0.26)
    bands = [lathe(outline[at] + [0.01, 0]) for at in ([3, 4], [6, 7])]
    scoop = ball((0.2, 0.2, draw(0.16, 0.22)), (0, 0, 0), sides=20)
    cone = lathe(outline)
    styles = (
        join(cone, *bands, boxes((wide, wide, 0.04, 0, 0, -0.04))),
        join(cone, lathe([(rim, -0.02), (rim, 0)])),
        stretch(join(cone, scoop), (1, 1, -1)),
    )
    return draw.pick(styles)


def cup(draw: Draw) -> Mesh:
    """A cup with a handle, straight, tapered or bellied, on a saucer or not."""
    outline, wide = _outline(CUP, draw), draw(0.06, 0.08)
    loop = arc(1, -90, 90, 9) * [draw(0.02, 0.03), 0.025] + [0.95 * outline[8, 0], 0.047]
    saucer = hollow([(0.5 * wide, -0.012), (wide, 0), (wide, 0.004)], 0.006, -0.01)
    handle = tube(np.insert(loop, 1, 0, axis=1), draw(0.003, 0.006))
    return join(hollow(outline, 0.004, 0.006), handle, *draw.maybe(0.4, saucer))


def lamp(draw: Draw) -> Mesh:
    """A lamp: on a table, on the floor, or on a jointed arm."""
    foot, wide, tall = draw(0.08, 0.16), draw(0.1, 0.2), draw(0.12, 0.24)
    base = lathe([(foot, 0), (foot, 0.02), (draw(0.3, 0.9) * foot, 0.035), (0.012, 0.05)])
    shade = hollow([(draw(0.4, 0.95) * wide, -tall), (wide, 0)], 0.006, 0.01 - tall)
    bulb = ball((0.03, 0.03, 0.045), (0, 0, 0.3 * tall), sides=10)
    head = join(stretch(shade, (1, 1, -1)), bulb, rod((0, 0, 0), (0, 0, tall), 0.006))
    bent = turn(stretch(head, (0.6, 0.6, 0.6)), "y", draw(-50, -10))
    elbow, end = (-0.17, 0, 0.42), (0.17, 0, 0.59)
    styles = (
        join(lathe(_outline(LAMP, draw), 16), place(head, (0, 0, 0.4))),
        join(rod((0, 0, 0), (0, 0, 1.45), 0.014), place(head, (0, 0, 1.45))),
        join(rod((0, 0, 0.03), elbow, 0.012), rod(elbow, end, 0.01), place(bent, end)),
    )
    return join(base, draw.pick(styles))


def vase(draw: Draw) -> Mesh:
    """A vase: a belly and a waist anywhere, round or many-sided, with ears or without."""
    outline = _outline(VASE, draw)
    neck, side = outline[14], outline[10]
    ear = np.insert(smooth([neck, (neck[0] + 0.06, neck[1]), side], 8), 1, 0, axis=1)
    stems = [_flower(0.32, 0.03, draw) for _ in range(draw.whole(2, 4))]
    return join(
        hollow(outline, 0.006, 0.018, draw.pick((6, 8, 24, 24))),
        *draw.maybe(0.35, both_sides(tube(ear, 0.008))),
        *draw.maybe(0.3, place(join(*stems), (0, 0, 0.14))),
    )


def flower_pot(draw: Draw) -> Mesh:
    """A wide pot with some short flowers, on a saucer or not."""
    flowers = [
        place(
            _flower(draw(0.11, 0.23), draw(0.018, 0.033), draw),
            (draw(-0.075, 0.075), draw(-0.075, 0.075), 0.14),
        )
        for _ in range(draw.whole(3, 7))
    ]
    saucer = lathe([(0.12, -0.02), (0.17, 0.01), (0.17, 0.02)])
    return join(_pot(0.15, draw), *flowers, *draw.maybe(0.5, saucer))


def _pot(radius: Real, draw: Draw) -> Mesh:
    """A tapered pot with a rim, 19 cm high and filled with earth; round or square."""
    rim, sides = draw(1.05, 1.2) * radius, draw.pick((4, 24, 24, 24))
    outline = [(draw(0.55, 0.85) * radius, 0), (radius, 0.155), (rim, 0.155), (rim, 0.19)]
    return turn(hollow(outline, 0.15 * radius, 0.14, sides), "z", 45)


def _flower(length: Real, head: Real, draw: Draw) -> Mesh:
    """A stem that leans somewhere, with a petalled head."""
    s, lean = np.linspace(0, 1, 5), draw(0.05, 0.35)
    stem = np.column_stack([lean * s**2, 0 * s, s]) * length
    petal = leaf((0, 0, 0), (2 * head, 0, 0.3 * head), head, 0.1 * head, steps=4)
    petals = [turn(petal, "z", angle) for angle in range(0, 360, 72)]
    bloom = join(ball((head / 2, head / 2, head / 2), (0, 0, 0), sides=6), *petals)
    made = join(tube(stem, 0.12 * head, sides=5), place(bloom, stem[-1]))
    return turn(made, "z", draw(0, 360))


def plant(draw: Draw) -> Mesh:
    """A tall plant in a small pot: upright blades, a palm, or a bush on a branching stem."""
    frond, tall = draw.pick((_blade, _palm_leaf, _twig)), draw(0.5, 1.3)
    trunk = 0.05 if frond is _blade else draw(0.3, 0.6) * tall
    crown = np.array([draw(-0.2, 0.2) * trunk, draw(-0.2, 0.2) * trunk, 0.19 + trunk])
    middle = crown * [0.2, 0.2, 1] - [0, 0, 0.5 * trunk]
    fronds = [
        place(frond(tall, trunk, draw), crown, 137.5 * number + draw(-25, 25))
        for number in range(draw.whole(9, 19))
    ]
    return join(
        _pot(0.13, draw), tube([(0, 0, 0.13), middle, crown], [0.03, 0.025, 0.018]), *fronds
    )


def _blade(tall: Real, trunk: Real, draw: Draw) -> Mesh:
    length = draw(0.5, 1.0) * tall
    return leaf((0.02, 0, -trunk), (draw(0.1, 0.35) * length, 0, length), 0.09, 0, 7)


def _palm_leaf(tall: Real, trunk: Real, draw: Draw) -> Mesh:
    length = draw(0.35, 0.6) * tall
    tip = (length, 0, -draw(0.0, 0.3) * min(length, trunk))
    return leaf((0, 0, 0), tip, 0.16 * length, 0.25 * length, 8)


def _twig(tall: Real, trunk: Real, draw: Draw) -> Mesh:
    out, up, size = draw(0.08, 0.25) * tall, draw(-0.5, 0.35) * trunk, draw(0.12, 0.2) * tall
    blade = leaf((out, 0, up), (out + size, 0, up + draw(-0.3, 0.3) * size), 0.7 * size, 0.1 * size)
    return join(rod((0, 0, -0.4 * trunk), (out, 0, up), 0.008), blade)
