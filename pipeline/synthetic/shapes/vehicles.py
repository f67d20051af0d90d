"""Made-up vehicles, and the person who steers them: airplane, car, person."""

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.solids import (
    Real,
    Vector,
    ball,
    block,
    cushion,
    disc,
    join,
    lathe,
    move,
    oval,
    rod,
    skin,
    smooth,
    stretch,
    tube,
    turn,
)


def airplane(*, generator: np.random.Generator) -> Mesh:
    """An airplane, nose to -y: jets under the wings or at the tail, or a propeller."""
    draw = generator.uniform
    length, radius = draw(10, 60), draw(0.04, 0.07)
    span, sweep, high = draw(0.35, 0.6), draw(0.0, 0.3), generator.random() < 0.3
    body = smooth([(0.15, 0), (0.8, 0.06), (1, 0.18), (1, 0.65), (0.6, 0.85), (0.12, 1)], 16)
    along = np.column_stack([0 * body[:, 0], body[:, 1] - 0.5, 0.04 * body[:, 1] ** 4])
    level, chord = (0.7 if high else -0.5) * radius, draw(0.12, 0.24)
    wing = _wing(
        (0.5 * radius, -0.1, level),
        (span, -0.1 + sweep, level + draw(0, 0.05)),
        chord,
        draw(0.25, 0.7),
    )
    fin_top = draw(0.12, 0.2)
    tail_level = fin_top if generator.random() < 0.3 else 0.04
    tailplane = _wing(
        (0, 0.4, tail_level), (draw(0.13, 0.22), 0.4 + 0.5 * sweep, tail_level), 0.1, 0.5
    )
    fin = turn(_wing((0, 0.37, 0), (fin_top, 0.37 + draw(0.04, 0.1), 0), 0.13, 0.5), "y", -90)
    half = [wing, tailplane, *_engines(span, sweep, level, radius, generator=generator)]
    cockpit = ball((0, -0.4, 0.6 * radius), (0.5 * radius, 0.06, 0.5 * radius), sides=10)
    wheels = [disc((0, -0.36, -1.4 * radius), "x", 0.015, 0.015, 10)]
    half.append(disc((0.05, 0.02, -1.5 * radius), "x", 0.02, 0.02, 10))
    half.append(rod((0.04, 0.02, -1.5 * radius), (0.04, 0.0, -0.3 * radius), 0.006))
    right = join(*half)
    made = join(
        tube(along, (body[:, 0] * radius).tolist(), 16),
        fin,
        cockpit,
        *wheels,
        right,
        stretch(right, (-1, 1, 1)),
    )
    return stretch(made, (length, length, length))


def _wing(root: Vector, tip: Vector, chord: Real, taper: Real) -> Mesh:
    """A wing from ``root`` out to ``tip``: two ellipses across, thin and wide."""
    rings = []
    for at, size in ((root, chord), (tip, chord * taper)):
        flat = oval((0, 0, 0), size, 0.1 * size, sides=12)
        rings.append(np.column_stack([flat[:, 2], flat[:, 0], flat[:, 1]]) + np.array(at))
    return skin(np.stack(rings))


def _engines(
    span: Real, sweep: Real, level: Real, radius: Real, *, generator: np.random.Generator
) -> list[Mesh]:
    """The engines of the right half: one or two under the wing, one at the tail, or a propeller."""
    style = int(generator.integers(4))
    size = generator.uniform(0.4, 0.6) * radius
    if style == 3:
        blade = stretch(ball((0, 0, 0), (1, 1, 1), sides=8), (0.012, 0.004, 0.1))
        return [move(turn(blade, "y", angle), (0, -0.52, 0)) for angle in (20, 140, 260)]
    if style == 2:
        places = [(2.0 * radius, 0.3, 0.6 * radius)]
    else:
        shares = (0.35,) if style == 0 else (0.3, 0.6)
        places = [(s * span, -0.15 + s * sweep, level - 1.2 * size) for s in shares]
    return [
        tube(
            [(x, y - 0.05, z), (x, y - 0.04, z), (x, y + 0.03, z), (x, y + 0.06, z)],
            [0.8 * size, size, 0.9 * size, 0.5 * size],
            12,
        )
        for x, y, z in places
    ]


def car(*, generator: np.random.Generator) -> Mesh:
    """A car, front to -y: saloon, estate, van, pick-up or sports car."""
    draw = generator.uniform
    length, width, height = draw(3.6, 5.0), draw(1.6, 1.95), draw(1.35, 1.6)
    style = int(generator.integers(5))
    # where the cabin begins and ends, low and high, as shares of the length from the front
    low = ((0.26, 0.85), (0.25, 0.98), (0.08, 0.99), (0.25, 0.6), (0.38, 0.92))[style]
    high = ((0.42, 0.72), (0.38, 0.92), (0.2, 0.97), (0.36, 0.57), (0.52, 0.7))[style]
    height *= (1, 1, 1.3, 1.15, 0.82)[style]
    ground, wheel, belt = draw(0.15, 0.28), draw(0.28, 0.36), draw(0.5, 0.6) * height
    body = [(0.9, 0.97, ground), (1, 1, ground + 0.15), (1, 1, 0.8 * belt), (0.92, 0.97, belt)]
    rings = [oval((0, 0, z), a * width, b * length, 6, 28) for a, b, z in body]
    cabin = []
    for (front, rear), wide, z in ((low, 0.9, belt), (high, 0.72, height)):
        deep = (rear - front) * length
        cabin.append(oval((0, (front + rear - 1) / 2 * length, z), wide * width, deep, 7, 28))
    parts = [skin(np.stack(rings)), skin(np.stack(cabin))]
    axles = (-draw(0.28, 0.33) * length, draw(0.27, 0.33) * length)
    parts += [_wheel(side * 0.46 * width, y, wheel, side) for side in (-1, 1) for y in axles]
    nose, mirror = -0.5 * length, (low[0] - 0.45) * length
    for side in (-1, 1):
        parts.append(
            ball((side * 0.34 * width, nose + 0.05, 0.8 * belt), (0.14, 0.08, 0.08), sides=8)
        )
        parts.append(
            cushion(
                (side * 0.54 * width - 0.1, side * 0.54 * width + 0.1),
                (mirror, mirror + 0.08),
                (belt, belt + 0.13),
                4,
                8,
            )
        )
        parts.append(
            block(
                (side * 0.38 * width - 0.12, side * 0.38 * width + 0.12),
                (-nose - 0.04, -nose + 0.02),
                (0.7 * belt, 0.85 * belt),
            )
        )
    parts.append(
        block(
            (-0.45 * width, 0.45 * width), (nose - 0.06, nose + 0.1), (ground + 0.05, ground + 0.2)
        )
    )
    if style == 3:  # the walls of the load bed
        bed = (0.61 - 0.5) * length
        parts += [
            block((at - 0.04, at + 0.04), (bed, 0.49 * length), (belt, belt + 0.25))
            for at in (-0.44 * width, 0.44 * width)
        ]
    if style == 4 and generator.random() < 0.7:
        parts.append(
            block(
                (-0.4 * width, 0.4 * width),
                (0.44 * length, 0.49 * length),
                (belt + 0.15, belt + 0.19),
            )
        )
    return join(*parts)


def _wheel(x: Real, y: Real, radius: Real, side: int) -> Mesh:
    hub = disc((x + side * 0.11, y, radius), "x", 0.5 * radius, 0.04, 10)
    return join(disc((x, y, radius), "x", radius, 0.2, 18), hub)


def person(*, generator: np.random.Generator) -> Mesh:
    """A person who looks towards -y: stands, strides, waves or stretches out the arms."""
    draw = generator.uniform
    height, build = draw(1.5, 1.95), draw(0.85, 1.25)
    hip, shoulder = 0.5, 0.81
    half = 0.11 * build
    torso = [
        (0.07, 0.05, 0.47),
        (0.095, 0.065, 0.52),
        (0.075, 0.055, 0.63),
        (0.1, 0.065, 0.74),
        (0.09, 0.05, 0.81),
        (0.03, 0.03, 0.84),
        (0.03, 0.03, 0.88),
    ]
    rings = [oval((0, 0, z), 2 * a * build, 2 * b * build, 2.5, 16) for a, b, z in torso]
    parts = [
        skin(np.stack(rings)),
        ball((0, -0.01, 0.93), (0.045, 0.055, 0.068), sides=14),
        ball((0, -0.065, 0.925), (0.01, 0.015, 0.012), sides=6),
    ]
    stride = (draw(-5, 5), draw(15, 35))[generator.integers(2)]
    for side in (-1, 1):
        parts.append(_leg(side * 0.055 * build, hip, side * stride, build, bend=draw(0, 30)))
        swing, raised = -side * stride * draw(0.6, 1.2), draw(5, 20)
        if generator.random() < 0.35:
            raised = draw(60, 150)
        parts.append(_arm((side * half, 0, shoulder), swing, raised, bend=draw(5, 80), build=build))
    style = int(generator.integers(4))
    if style == 1:  # a skirt
        parts.append(lathe([(0.17 * build, 0.28), (0.08 * build, 0.6)], 16))
    if style == 2:  # a hat
        parts.append(
            move(lathe([(0.09, 0), (0.09, 0.01), (0.05, 0.012), (0.045, 0.06)], 16), (0, 0, 0.96))
        )
    if style == 3:  # a rucksack
        parts.append(cushion((-0.07, 0.07), (0.05 * build, 0.05 * build + 0.09), (0.6, 0.8), 4))
    return stretch(join(*parts), (height, height, height))


def _leg(x: Real, hip: Real, swing_deg: Real, build: Real, bend: Real) -> Mesh:
    thigh, shin = 0.25, 0.22
    r = 0.045 * build
    knee = join(
        tube([(x, 0, hip), (x, 0, hip - thigh)], [1.15 * r, 0.8 * r], 10),
        turn(
            join(
                tube(
                    [
                        (x, 0, hip - thigh + 0.01),
                        (x, 0, hip - thigh - 0.1),
                        (x, 0, hip - thigh - shin),
                    ],
                    [0.8 * r, 0.85 * r, 0.5 * r],
                    10,
                ),
                ball((x, -0.035, hip - thigh - shin - 0.012), (0.028, 0.075, 0.025), sides=8),
            ),
            "x",
            -bend if swing_deg < 0 else -0.2 * bend,
            about=(x, 0, hip - thigh),
        ),
    )
    return turn(knee, "x", -swing_deg, about=(x, 0, hip))


def _arm(shoulder: Vector, swing_deg: Real, raised_deg: Real, bend: Real, build: Real) -> Mesh:
    """An arm that hangs down, bent forwards at the elbow, then swung, then raised sideways."""
    x, y, z = shoulder
    side = 1 if x > 0 else -1
    r = 0.03 * build
    lower = join(
        tube([(x, y, z - 0.16), (x, y, z - 0.31)], [0.8 * r, 0.55 * r], 8),
        ball((x, y, z - 0.35), (0.012, 0.025, 0.045), sides=8),
    )
    lower = turn(lower, "x", -bend, about=(x, y, z - 0.165))
    upper = tube(
        [(x, y, z + 0.01), (x, y, z - 0.05), (x, y, z - 0.17)], [0.9 * r, 1.1 * r, 0.8 * r], 8
    )
    arm = turn(join(upper, lower), "x", -swing_deg, about=shoulder)
    return turn(arm, "y", -side * raised_deg, about=shoulder)
