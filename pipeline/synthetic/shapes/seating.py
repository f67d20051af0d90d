"""Made-up things to sit or lie on: bed, bench, chair, sofa, stool."""

from itertools import pairwise

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    LEG_STYLES,
    arc,
    legs,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
    block,
    cushion,
    disc,
    join,
    lathe,
    move,
    rod,
    slab,
    tube,
    turn,
)


def bed(*, generator: np.random.Generator) -> Mesh:
    """A bed: frame, mattress, blanket, pillows, headboard and, perhaps, footboard."""
    draw = generator.uniform
    width, length, top = draw(0.9, 2.0), draw(1.9, 2.2), draw(0.3, 0.5)
    x, y, thick = (-width / 2, width / 2), (-length / 2, length / 2), draw(0.15, 0.3)
    frame = block((x[0] - 0.04, x[1] + 0.04), (y[0] - 0.04, y[1] + 0.04), (top - 0.2, top))
    mattress = cushion(x, y, (top, top + thick), squareness=8)
    fold = y[1] - draw(0.5, 0.8)
    blanket = cushion(
        (x[0] - 0.03, x[1] + 0.03), (y[0] - 0.03, fold), (top + 0.3 * thick, top + thick + 0.04), 9
    )
    pillows = _pillows(x, y[1], top + thick, 1 if width < 1.3 else 2)
    feet = legs(x, y, (0, top - 0.2), draw(0.06, 0.12), LEG_STYLES[generator.integers(2)])
    head = _headboard(x, y[1] + 0.04, top + draw(0.5, 0.9), style=int(generator.integers(3)))
    parts = [frame, mattress, blanket, pillows, feet, head]
    if generator.random() < 0.5:
        parts.append(block(x, (y[0] - 0.1, y[0] - 0.04), (0, top + draw(0.1, 0.35))))
    if generator.random() < 0.4:  # a rail on one side, as on a child's bed
        parts.append(block((x[1], x[1] + 0.04), (-0.5, 0.3), (top, top + thick + 0.25)))
    return join(*parts)


def _pillows(x: Span, head: Real, height: Real, count: int) -> Mesh:
    edges = np.linspace(x[0] + 0.08, x[1] - 0.08, count + 1)
    return join(
        *(
            cushion(
                (left + 0.03, right - 0.03), (head - 0.45, head - 0.06), (height, height + 0.14), 3
            )
            for left, right in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
        )
    )


def _headboard(x: Span, y: Real, height: Real, style: int) -> Mesh:
    if style == 0:
        return block((x[0] - 0.05, x[1] + 0.05), (y, y + 0.08), (0, height))
    if style == 1:
        half = (x[1] - x[0]) / 2
        crown = [
            (half * np.cos(a), height - 0.3 + 0.3 * np.sin(a)) for a in np.linspace(0, np.pi, 12)
        ]
        return slab([*crown, (x[0], 0.1), (x[1], 0.1)], (y, y + 0.06), "y")
    bars = [
        rod((at, y + 0.03, 0.1), (at, y + 0.03, height), 0.02) for at in np.linspace(*x, 9).tolist()
    ]
    return join(rod((x[0], y + 0.03, height), (x[1], y + 0.03, height), 0.035), *bars)


def bench(*, generator: np.random.Generator) -> Mesh:
    """A park bench: slats on two stands, a back, and arms on none, one or both ends."""
    draw = generator.uniform
    length, depth, height = draw(1.1, 2.0), draw(0.38, 0.5), draw(0.4, 0.48)
    x = (-length / 2, length / 2)
    slats, tilt, tall = int(generator.integers(2, 6)), draw(5, 20), draw(0.3, 0.5)
    edges = np.linspace(-depth / 2, depth / 2, slats + 1).tolist()
    parts = [block(x, (a, b - 0.02), (height - 0.04, height)) for a, b in pairwise(edges)]
    rows = np.linspace(height + 0.1, height + tall, int(generator.integers(1, 4)) + 1).tolist()
    back = [block(x, (depth / 2, depth / 2 + 0.03), (a, b - 0.03)) for a, b in pairwise(rows)]
    stile = block((-0.03, 0.03), (depth / 2, depth / 2 + 0.05), (height - 0.04, height + tall))
    stands = (x[0] + 0.15, x[1] - draw(0.15, 0.35))
    back += [move(stile, (at, 0, 0)) for at in stands]
    parts.append(turn(join(*back), "x", -tilt, about=(0, depth / 2, height)))
    parts += [_bench_stand(at, depth, height, style=int(generator.integers(3))) for at in stands]
    arms = int(generator.integers(3))
    for end in (x[0] + 0.04, x[1] - 0.04)[:arms]:
        loop = [(end, -depth / 2, height - 0.02), (end, -depth / 2, height + 0.22)]
        parts.append(tube([*loop, (end, 0, height + 0.25), (end, depth / 2, height + 0.22)], 0.025))
    return join(*parts)


def _bench_stand(at: Real, depth: Real, height: Real, style: int) -> Mesh:
    if style == 0:  # a solid cheek
        return block((at - 0.06, at + 0.06), (-0.45 * depth, 0.45 * depth), (0, height - 0.04), 0.8)
    foot = -0.45 * depth if style == 1 else -0.2 * depth
    front = rod((at, foot, 0), (at, -0.4 * depth, height - 0.04), 0.03)
    rear = rod((at, 0.6 * depth, 0), (at, 0.4 * depth, height - 0.04), 0.03)
    return join(front, rear, rod((at, foot, 0.1), (at, 0.55 * depth, 0.1), 0.02))


def chair(*, generator: np.random.Generator) -> Mesh:
    """A chair on four legs, a pedestal or runners, its back of panel, slats or bars."""
    draw = generator.uniform
    width, depth, height = draw(0.4, 0.58), draw(0.4, 0.55), draw(0.4, 0.5)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    seat = cushion(x, y, (height - draw(0.04, 0.1), height), squareness=draw(3, 9))
    tall = draw(0.35, 0.75)
    back = _chair_back(x, (height, height + tall), style=int(generator.integers(4)))
    back = turn(move(back, (0, y[1] - 0.04, 0)), "x", -draw(3, 18), about=(0, y[1], height))
    parts = [seat, back, _chair_base(x, y, height - 0.05, generator=generator)]
    if generator.random() < 0.45:
        rest, front = height + draw(0.18, 0.26), y[0] + draw(0.02, 0.12)
        for at in x:
            post = [(at, front, height - 0.04), (at, front, rest), (at, y[1], rest)]
            parts.append(tube(post, 0.02))
            parts.append(block((at - 0.03, at + 0.03), (front, y[1]), (rest, rest + 0.025)))
    return join(*parts)


def _chair_back(x: Span, z: Span, style: int) -> Mesh:
    low, high = z[0] + 0.25 * (z[1] - z[0]), z[1]
    stiles = [rod((at, 0, z[0] - 0.05), (at, 0, high), 0.02) for at in (x[0] + 0.02, x[1] - 0.02)]
    if style == 0:
        return cushion((x[0] + 0.02, x[1] - 0.02), (-0.03, 0.04), (z[0], high), 4)
    if style == 1:
        rails = [
            block(x, (-0.012, 0.012), (h, h + 0.06))
            for h in np.linspace(low, high - 0.06, 3).tolist()
        ]
        return join(*stiles, *rails)
    if style == 2:
        bars = [rod((at, 0, z[0]), (at, 0, high), 0.01) for at in np.linspace(*x, 8)[1:-1].tolist()]
        return join(*stiles, *bars, block(x, (-0.015, 0.015), (high - 0.07, high)))
    ring = [
        ((x[1] - 0.02) * np.cos(a), high - 0.2 + 0.2 * np.sin(a)) for a in np.linspace(0, np.pi, 12)
    ]
    return join(
        *stiles, slab([*ring, (x[0] + 0.02, low), (x[1] - 0.02, low)], (-0.012, 0.012), "y")
    )


def _chair_base(x: Span, y: Span, top: Real, *, generator: np.random.Generator) -> Mesh:
    style = int(generator.integers(5))
    if style < 3:
        return legs(x, y, (0, top), generator.uniform(0.03, 0.055), LEG_STYLES[style])
    if style == 3:
        runners = [
            tube(
                [(at, y[1], 0.02), (at, y[0], 0.02), (at, y[0] + 0.03, top), (at, y[1] - 0.1, top)],
                0.014,
            )
            for at in x
        ]
        return join(*runners, rod((x[0], y[1], 0.02), (x[1], y[1], 0.02), 0.014))
    return _star_base(top, int(generator.integers(4, 6)), 0.5 * (x[1] - x[0]) + 0.08)


def _star_base(top: Real, arms: int, reach: Real) -> Mesh:
    """A pedestal on ``arms`` arms with castors."""
    parts = [rod((0, 0, 0.1), (0, 0, top), 0.03)]
    for angle in np.linspace(0, 360, arms, endpoint=False).tolist():
        arm = join(
            rod((0, 0, 0.12), (reach, 0, 0.07), 0.025, 0.015),
            disc((reach, 0, 0.03), "x", 0.03, 0.03),
        )
        parts.append(turn(arm, "z", angle))
    return join(*parts)


def sofa(*, generator: np.random.Generator) -> Mesh:
    """A sofa: seat and back cushions between arms, a chaise at one end or none."""
    draw = generator.uniform
    seats = int(generator.integers(1, 5))
    width, depth, height = seats * draw(0.55, 0.75), draw(0.75, 0.95), draw(0.36, 0.46)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    arm, rest, tall = draw(0.1, 0.25), height + draw(0.12, 0.25), height + draw(0.35, 0.55)
    outer = (x[0] - arm, x[1] + arm)
    foot = draw(0.04, 0.16)
    edges = np.linspace(*x, seats + 1).tolist()
    parts = [
        block(outer, y, (foot, height - 0.14)),
        cushion(outer, (y[1] - 0.2, y[1]), (foot, tall), squareness=7),
        legs(outer, y, (0, foot), 0.06, LEG_STYLES[generator.integers(2)]),
    ]
    parts += [cushion(side, y, (foot, rest), 6) for side in ((outer[0], x[0]), (x[1], outer[1]))]
    for left, right in pairwise(edges):
        seat = cushion((left, right - 0.01), (y[0] - 0.02, y[1] - 0.2), (height - 0.14, height), 7)
        back = cushion((left, right - 0.01), (y[1] - 0.34, y[1] - 0.2), (height, tall - 0.06), 5)
        parts += [seat, turn(back, "x", -8, about=(0, y[1] - 0.2, height))]
    if seats > 1 and generator.random() < 0.4:
        end = edges[:2] if generator.random() < 0.5 else edges[-2:]
        parts.append(cushion((end[0], end[1]), (y[0] - draw(0.4, 0.8), y[0]), (foot, height), 7))
    if generator.random() < 0.5:
        throw = cushion((-0.2, 0.2), (-0.06, 0.06), (0, 0.38), 3)
        parts.append(move(turn(throw, "x", -25), (x[0] + 0.25, y[1] - 0.45, height)))
    return join(*parts)


def stool(*, generator: np.random.Generator) -> Mesh:
    """A stool: round or square seat with a low back rest, and a foot rest in front only."""
    draw = generator.uniform
    height, radius, seat = draw(0.45, 0.8), draw(0.16, 0.22), draw(0.03, 0.07)
    squareness = 2 if generator.random() < 0.6 else 7
    parts = [
        cushion((-radius, radius), (-radius, radius), (height - seat, height), squareness),
        _stool_back(radius, height, draw(0.08, 0.3)),
    ]
    step, spread = draw(0.25, 0.4) * height, draw(1.0, 1.35) * radius
    base = int(generator.integers(3))
    if base == 2:
        parts += [lathe([(spread, 0), (spread, 0.02), (0.03, 0.05), (0.03, height - seat)])]
        parts.append(tube(arc((0, 0, step), radius, 180, 360), 0.012))
        parts += [rod((side * radius, 0, step), (0, 0, step), 0.012) for side in (-1, 1)]
        return join(*parts)
    count = 3 + base
    first = 90.0 if count == 3 else 45.0
    feet = arc((0, 0, 0), spread, first, first + 360, count + 1)[:-1]
    for x, y, _ in feet.tolist():
        parts.append(rod((x, y, 0), (0.75 * x, 0.75 * y, height - seat), 0.018))
    left, right = ((0.92 * x, 0.92 * y, step) for x, y, _ in feet[-2:].tolist())
    return join(*parts, rod(left, right, 0.022))


def _stool_back(radius: Real, height: Real, tall: Real) -> Mesh:
    rim = arc((0, 0, height + tall), 0.95 * radius, 35, 145)
    posts = [
        rod((p[0], p[1], height - 0.02), (p[0], p[1], height + tall), 0.012)
        for p in rim[[1, -2]].tolist()
    ]
    return join(tube(rim, 0.025), *posts)
