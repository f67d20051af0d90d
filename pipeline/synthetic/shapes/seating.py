"""Tops, seats and beds on legs: bed, bench, chair, desk, sofa, stool, table."""

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import LEGS, Stand, carcass, drawers, spaced, stand
from pipeline.synthetic.shapes.solids import (
    Real,
    Row,
    arc,
    both_sides,
    boxes,
    cushion,
    join,
    place,
    rod,
    slab,
    stretch,
    tube,
    turn,
)

CHAIR_STANDS: tuple[Stand, ...] = (*LEGS, "runners", "star")
TABLE_STANDS: tuple[Stand, ...] = (*LEGS, "trestle", "pedestal")


def table(draw: Draw) -> Mesh:
    """A table with a drawer on one side and a rail on the other, its top oblong, oval or round."""
    squareness, inner = draw.pick(((2, 0.7), (3, 0.75), (12, 0.94)))
    width, depth, y, wide = 1.4 * inner, 0.85 * inner, 0.42 * inner, draw(0.3, 0.5)
    drawer = join(carcass(wide, 0.4, 0.1, 0.012), place(drawers(wide, 0.11, 1, draw), (0, -0.2, 0)))
    out, hang = draw(0.03, 0.15), draw(0.15, 0.3)
    return join(
        cushion((1.4, 0.85, 0.04), (0, 0, 0.56), squareness, sides=32),
        place(drawer, (draw(-0.5, 0.5) * (width - wide), 0.2 - y - out, 0.45)),
        stand(draw.pick(TABLE_STANDS), width, depth, 0.56, draw(0.04, 0.1)),
        boxes((width, 0.03, 0.1, 0, y, 0.46)),
        *draw.maybe(0.4, boxes((0.03, 0.6, hang, 0.7, 0, 0.6 - hang))),  # a leaf, folded down
    )


def desk(draw: Draw) -> Mesh:
    """A desk: drawers at one end, legs or a panel at the other, a hutch or a short arm."""
    wide, foot, panel, arm = draw(0.35, 0.55), draw(0.01, 0.12), draw(0.3, 0.55), draw(0.4, 0.8)
    chest = join(
        boxes((wide, 0.62, 0.7 - foot, 0, 0.01, foot)),
        place(drawers(wide, 0.7 - foot, draw.whole(2, 4), draw), (0, -0.3, foot)),
        stand("square", wide, 0.64, foot, 0.05),
    )
    legs: list[Row] = [(0.06, 0.06, 0.7, 0.67, y, 0) for y in (-0.29, 0.29)]
    rows: list[Row] = [
        (1.44, 0.66, 0.04, 0, -0.01, 0.7),
        (1.4 - wide, 0.02, panel, wide / 2, 0.29, 0.7 - panel),
    ]
    rows += draw.pick((legs, [(0.04, 0.64, 0.7, 0.68, 0, 0)]))
    short_arm = [
        (0.5, arm, 0.04, 0.45, -0.32 - arm / 2, 0.7),
        (0.5, 0.03, 0.7, 0.45, -0.3 - arm, 0),
    ]
    hutch = place(carcass(1.4, 0.25, draw(0.25, 0.5), 0.02), (0, 0.2, 0.74))
    extra = draw.maybe(0.67, draw.pick((boxes(*short_arm), hutch)))
    made = join(boxes(*rows), place(chest, (wide / 2 - 0.7, 0, 0)), *extra)
    return stretch(made, (draw.pick((-1, 1)), 1, 1))


def bed(draw: Draw) -> Mesh:
    """A bed: frame, mattress, blanket, pillows, headboard and, perhaps, footboard and rail."""
    fold, thick = draw(0.5, 0.8), draw(0.15, 0.3)
    pillow = cushion((0.6, 0.39, 0.14), (0.34, 0.78, 0.4 + thick), 3)
    return join(
        boxes((1.53, 2.13, 0.2, 0, 0, 0.2)),
        cushion((1.45, 2.05, thick), (0, 0, 0.4), 8),
        cushion((1.51, 2.05 - fold, 0.2), (0, -fold / 2 - 0.03, 0.24 + thick), 9),
        draw.pick((both_sides(pillow), place(pillow, (-0.34, 0, 0)))),
        stand(draw.pick(LEGS), 1.45, 2.05, 0.2, 0.09),
        place(_headboard(draw), (0, 1.06, 0)),
        *draw.maybe(0.5, boxes((1.45, 0.06, draw(0.5, 0.75), 0, -1.1, 0))),
        *draw.maybe(0.4, boxes((0.04, 0.8, thick + 0.25, 0.745, -0.1, 0.4))),  # a child's rail
    )


def _headboard(draw: Draw) -> Mesh:
    """A board, an arched one, or bars."""
    height = draw(0.9, 1.3)
    arch = arc(1, 0, 180, 12) * [0.72, 0.3] + [0, height - 0.3]
    bars = [rod((x, 0, 0.1), (x, 0, height), 0.02) for x in spaced(-0.72, 0.72, 9)]
    styles = (
        boxes((1.55, 0.08, height, 0, 0.04, 0)),
        slab([*arch, (-0.72, 0.1), (0.72, 0.1)], (0, 0.06), "y"),
        join(rod((-0.72, 0, height), (0.72, 0, height), 0.035), *bars),
    )
    return draw.pick(styles)


def bench(draw: Draw) -> Mesh:
    """A park bench: slats on two stands, a back, and arms on none, one or both ends."""
    slats, rails, tall, foot = draw.whole(3, 5), draw.whole(2, 3), draw(0.3, 0.5), draw(-0.2, -0.09)
    each, rise, ends = 0.44 / slats, (tall - 0.1) / rails, (-0.62, 0.77 - draw(0.15, 0.35))
    seat = [(1.54, each - 0.02, 0.04, 0, (n + 0.5) * each - 0.22, 0.4) for n in range(slats)]
    back: list[Row] = [(1.54, 0.03, rise - 0.03, 0, 0.015, 0.1 + n * rise) for n in range(rails)]
    back += [(0.06, 0.05, tall + 0.04, x, 0.025, -0.04) for x in ends]
    legs = join(
        rod((0, foot, 0), (0, -0.18, 0.4), 0.03),
        rod((0, 0.26, 0), (0, 0.18, 0.4), 0.03),
        rod((0, foot, 0.1), (0, 0.24, 0.1), 0.02),
    )
    support = draw.pick((cushion((0.12, 0.4, 0.41), (0, 0, 0), 8), legs, legs))
    arm = tube([(0, -0.22, 0.42), (0, -0.22, 0.66), (0, 0, 0.69), (0, 0.22, 0.66)], 0.025)
    return join(
        boxes(*seat),
        place(turn(boxes(*back), "x", -draw(5, 20)), (0, 0.22, 0.44)),
        *(place(support, (x, 0, 0)) for x in ends),
        *(place(arm, (x, 0, 0)) for x in (-0.73, 0.73)[: draw.whole(0, 2)]),
    )


def chair(draw: Draw) -> Mesh:
    """A chair on legs, runners or a star, its back of panel, slats or bars, with arms or not."""
    back = turn(_chair_back(draw(0.35, 0.75), draw), "x", -draw(3, 18))
    post = tube([(0.24, -0.18, 0.4), (0.24, -0.18, 0.67), (0.24, 0.24, 0.67)], 0.02)
    rest = boxes((0.06, 0.42, 0.025, 0.24, 0.03, 0.67))
    return join(
        cushion((0.48, 0.48, 0.07), (0, 0, 0.38), squareness=draw(3, 9)),
        place(back, (0, 0.2, 0.45)),
        stand(draw.pick(CHAIR_STANDS), 0.48, 0.48, 0.39, draw(0.03, 0.055)),
        *draw.maybe(0.45, both_sides(join(post, rest))),
    )


def _chair_back(tall: Real, draw: Draw) -> Mesh:
    """A back on z = 0: panel, slats, bars or shield."""
    stiles = both_sides(rod((0.22, 0, -0.05), (0.22, 0, tall), 0.02))
    slats = [(0.48, 0.024, 0.06, 0, 0, z) for z in spaced(0.25 * tall, tall - 0.06, 3)]
    bars = [(0.02, 0.02, tall, x, 0, 0) for x in spaced(-0.17, 0.17, 6)]
    shield = arc(1, 0, 180, 12) * [0.22, 0.2] + [0, tall - 0.2]
    outline = [*shield, (-0.22, 0.25 * tall), (0.22, 0.25 * tall)]
    styles = (
        cushion((0.44, 0.07, tall), (0, 0, 0), 4),
        join(stiles, boxes(*slats)),
        join(stiles, boxes((0.48, 0.03, 0.07, 0, 0, tall - 0.07), *bars)),
        join(stiles, slab(outline, (-0.012, 0.012), "y")),
    )
    return draw.pick(styles)


def sofa(draw: Draw) -> Mesh:
    """A sofa: seat and back cushions between arms, a chaise at one end or none."""
    seats, arm, foot, tall = draw.whole(1, 4), draw(0.1, 0.25), draw(0.04, 0.16), draw(0.35, 0.55)
    inner, outer = 0.65 * seats, 0.65 * seats + 2 * arm
    side = cushion((arm, 0.85, draw(0.53, 0.66) - foot), ((inner + arm) / 2, 0, foot), 6)
    back = turn(cushion((0.64, 0.14, tall - 0.06), (0, -0.07, 0), 5), "x", -8)
    seat = cushion((0.64, 0.67, 0.14), (0, -0.11, 0.27), 7)
    places = spaced(0.325 - inner / 2, inner / 2 - 0.325, seats)
    far, end = draw(0.4, 0.8), draw.pick((places[0], places[-1]))
    chaise = cushion((0.65, far, 0.41 - foot), (end, -0.42 - far / 2, foot), 7)
    throw = turn(cushion((0.4, 0.12, 0.38), (0, 0, 0), 3), "x", -25)
    return join(
        boxes((outer, 0.85, 0.27 - foot, 0, 0, foot)),
        cushion((outer, 0.2, 0.41 + tall - foot), (0, 0.32, foot), 7),
        stand(draw.pick(LEGS), outer, 0.85, foot, 0.06),
        both_sides(side),
        *(place(seat, (x, 0, 0)) for x in places),
        *(place(back, (x, 0.22, 0.41)) for x in places),
        *draw.maybe(0.3, chaise),
        *draw.maybe(0.5, place(throw, (0.25 - inner / 2, -0.02, 0.41))),
    )


def stool(draw: Draw) -> Mesh:
    """A stool: round or square seat with a low back rest, and a foot rest in front only."""
    top, step, spread, feet = draw(0.7, 0.92), draw(0.15, 0.25), draw(0.19, 0.26), draw.whole(3, 5)
    rim = [(x, y, top) for x, y in arc(0.18, 35, 145).tolist()]
    ends = arc(spread, 270 - 180 / feet, 630 - 180 / feet, feet + 1).tolist()
    left, right = ((0.92 * x, 0.92 * y, step) for x, y in ends[:2])
    on_legs = [rod((x, y, 0), (0.75 * x, 0.75 * y, 0.57), 0.018) for x, y in ends[1:]]
    ring = tube([(x, y, step) for x, y in arc(0.19, 180, 360).tolist()], 0.012)
    spokes = rod((-0.19, 0, step), (0.19, 0, step), 0.012)
    pedestal = join(stand("pedestal", 3 * spread, 3 * spread, 0.57, 0.03), ring, spokes)
    base = join(*on_legs, rod(left, right, 0.022))
    return join(
        cushion((0.38, 0.38, 0.05), (0, 0, 0.57), draw.pick((2, 7))),
        tube(rim, 0.025),
        *(rod((x, y, 0.6), (x, y, z), 0.012) for x, y, z in rim[1::7]),
        draw.pick((base, base, pedestal)),
    )
