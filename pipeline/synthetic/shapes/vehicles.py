"""Vehicles, and the person who steers them: airplane, car, person."""

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.solids import (
    Real,
    Vector,
    ball,
    both_sides,
    boxes,
    cushion,
    disc,
    join,
    lathe,
    loft,
    oval,
    place,
    skin,
    smooth,
    stretch,
    tube,
    turn,
)


def airplane(draw: Draw) -> Mesh:
    """An airplane, nose to -y: jets under the wings or at the tail, or a propeller."""
    radius, span, sweep = draw(0.04, 0.07), draw(0.35, 0.6), draw(0.0, 0.3)
    level, tail = radius * draw.pick((0.7, -0.5, -0.5)), draw.pick((0.12, 0.04, 0.04))
    body = smooth([(0.15, 0), (0.8, 0.06), (1, 0.18), (1, 0.65), (0.6, 0.85), (0.12, 1)], 16)
    along = np.column_stack([0 * body[:, 0], body[:, 1] - 0.5, 0.04 * body[:, 1] ** 4])
    wing = _wing((0.5 * radius, -0.1, level), (span, sweep - 0.1, level), draw(0.12, 0.24))
    tailplane = _wing((0, 0.4, tail), (draw(0.13, 0.22), 0.4 + 0.5 * sweep, tail), 0.1)
    fin = turn(_wing((0, 0.37, 0), (draw(0.12, 0.2), draw(0.41, 0.47), 0), 0.13), "y", -90)
    gear = disc("x", 0.02, 0.02, (0.05, 0.02, -1.3 * radius), 10)
    engine = tube(
        [(0, -0.05, 0), (0, 0.03, 0), (0, 0.06, 0)],
        [0.5 * radius, 0.45 * radius, 0.25 * radius],
        12,
    )
    share, blade = draw(0.3, 0.6), ball((0.012, 0.004, 0.1), (0, -0.52, 0), sides=8)
    engines = (
        place(engine, (share * span, share * sweep - 0.15, level - 0.6 * radius)),
        place(engine, (2 * radius, 0.3, 0.6 * radius)),
        join(*(turn(blade, "y", angle) for angle in (20, 140, 260))),
    )
    right = join(wing, tailplane, gear, draw.pick(engines))
    made = join(tube(along, (radius * body[:, 0]).tolist(), 16), fin, both_sides(right))
    return stretch(made, (30, 30, 30))


def _wing(root: Vector, tip: Vector, chord: Real) -> Mesh:
    """A wing from ``root`` out to ``tip``: two ellipses across, thin and wide."""
    flat = oval(chord, 0.1 * chord, (0, 0, 0), sides=12)[:, [2, 0, 1]]
    return skin(np.stack([flat + np.asarray(root), 0.5 * flat + np.asarray(tip)]))


CARS = (  # where the cabin begins and ends, below and above; height
    (-1.0, 1.5, -0.35, 0.95, 1.48),  # saloon
    (-1.1, 2.05, -0.5, 1.8, 1.48),  # estate
    (-1.8, 2.1, -1.3, 2.0, 1.9),  # van
    (-1.1, 0.45, -0.6, 0.3, 1.7),  # pick-up
    (-0.5, 1.8, 0.1, 0.85, 1.22),  # sports car
)


def car(draw: Draw) -> Mesh:
    """A car, front to -y: saloon, estate, van, pick-up or sports car."""
    return join(*car_parts(draw))


def car_parts(draw: Draw) -> tuple[Mesh, Mesh, Mesh]:
    """A car's body, its windows and its wheels; it stands on z = 0, its front to -y."""
    front, rear, brow, end, height = draw.pick(CARS)
    belt, radius, ground = 0.55 * height, draw(0.28, 0.36), draw(0.15, 0.28)
    shell = [(1.6, 4.2, ground), (1.78, 4.3, ground + 0.15), (1.78, 4.3, 0.8 * belt)]
    rows = [
        (1.6, 0.16, 0.15, 0, -2.13, ground + 0.05),
        (0.9, 0.9 * (end - brow), 0.03, 0, (brow + end) / 2, height - 0.02),
        *((0.2, 0.08, 0.13, x, front, belt) for x in (-0.9, 0.9)),
    ]
    if rear < 1:  # the walls of a load bed
        rows += [(0.08, 1.6, 0.25, x, 1.25, belt) for x in (-0.78, 0.78)]
    body = loft([(wide, long, 0, 0, z) for wide, long, z in (*shell, (1.64, 4.2, belt))], 6, 28)
    low, high = (1.6, rear - front, 0, (front + rear) / 2), (1.28, end - brow, 0, (brow + end) / 2)
    light = ball((0.14, 0.08, 0.08), (0.6, -2.1, 0.8 * belt), sides=8)
    wheels = [disc("x", radius, 0.22, (0.82, y, radius), 18) for y in (-1.3, 1.3)]
    size = [draw(0.87, 1.13) for _ in range(3)]
    parts = (
        join(body, boxes(*rows), both_sides(light)),
        loft([(*low, belt), (*high, height)], 7, 28),
        both_sides(join(*wheels)),
    )
    paint, glass, rubber = (stretch(part, size) for part in parts)
    return paint, glass, rubber


def person(draw: Draw) -> Mesh:
    """A person who looks towards -y: stands, strides, waves or stretches out the arms."""
    torso = [
        *((0.15, 0.1, 0.47), (0.2, 0.14, 0.52), (0.16, 0.12, 0.63), (0.21, 0.14, 0.74)),
        *((0.19, 0.1, 0.81), (0.06, 0.06, 0.84), (0.06, 0.06, 0.88)),
    ]
    worn = (
        ball((0.01, 0.015, 0.012), (0, -0.065, 0.925), sides=6),  # a nose alone
        lathe([(0.18, 0.28), (0.085, 0.6)], 16),  # a skirt
        lathe([(0.09, 0.96), (0.09, 0.97), (0.05, 0.972), (0.045, 1.02)], 16),  # a hat
        cushion((0.14, 0.09, 0.2), (0, 0.1, 0.6), 4),  # a rucksack
    )
    parts = [
        loft([(wide, deep, 0, 0, z) for wide, deep, z in torso], 2.5, 16),
        ball((0.045, 0.055, 0.068), (0, -0.01, 0.93), sides=14),
        draw.pick(worn),
    ]
    stride = draw.pick((draw(-5, 5), draw(15, 35)))
    for side in (-1, 1):
        raised = draw(60, 150) if draw.chance(0.35) else draw(5, 20)
        arm = _limb(ARM, -side * stride * draw(0.6, 1.2), -draw(5, 80))
        leg = _limb(LEG, side * stride, draw(0, 30) * (0.2 if side * stride > 0 else 1))
        parts.append(place(turn(arm, "y", -side * raised), (side * 0.115, 0, 0.81)))
        parts.append(place(leg, (side * 0.058, 0, 0.5)))
    return stretch(join(*parts), (1.72, 1.72, 1.72))


Limb = tuple[Real, tuple[Real, Real, Real], Vector, Real]
ARM: Limb = (0.165, (0.03, 0.033, 0.02), (0.012, 0.025, 0.045), -0.01)
LEG: Limb = (0.25, (0.052, 0.038, 0.024), (0.028, 0.075, 0.025), -0.035)
"""Length of either half; radii at the ends and between; those of hand or foot; how far before."""


def _limb(kind: Limb, swing_deg: Real, bend_deg: Real) -> Mesh:
    """A limb that hangs from the origin: bent backwards at its middle, then swung forwards."""
    half, (first, middle, last), tip, y = kind
    end = ball(tip, (0, y, -half), sides=8)
    lower = turn(join(tube([(0, 0, 0), (0, 0, -half)], [middle, last]), end), "x", -bend_deg)
    upper = tube([(0, 0, 0.01), (0, 0, -half / 2), (0, 0, -half)], [first, first, middle])
    return turn(join(upper, place(lower, (0, 0, -half))), "x", -swing_deg)
