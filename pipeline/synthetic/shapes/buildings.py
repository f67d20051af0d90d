"""Made-up parts of a building, and a tent: curtain, door, mantel, stairs, tent."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    arc,
    carcass,
    mirrored,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
    ball,
    block,
    disc,
    join,
    lathe,
    move,
    rod,
    sheet,
    skin,
    slab,
    stretch,
    turn,
)


def curtain(*, generator: np.random.Generator) -> Mesh:
    """One or two pleated panels of unequal width on a rod; a panel may be tied back."""
    draw = generator.uniform
    width, height, depth = draw(1.2, 2.6), draw(1.4, 2.6), draw(0.04, 0.1)
    drawn = draw(0.25, 0.45) * width
    rail = height + 0.05
    parts = [
        _pleats((-width / 2, -width / 2 + drawn), height, depth, generator=generator),
        rod((-width / 2 - 0.1, 0, rail), (width / 2 + 0.1, 0, rail), 0.018),
        ball((-width / 2 - 0.12, 0, rail), (0.05, 0.05, 0.05), sides=8),
        ball((width / 2 + 0.12, 0, rail), (0.05, 0.05, 0.05), sides=8),
    ]
    parts += [
        block((at - 0.02, at + 0.02), (0, 0.14), (rail - 0.03, rail + 0.03))
        for at in (-width / 2, width / 2)
    ]
    if generator.random() < 0.7:
        other = draw(0.12, 0.22) * width
        parts.append(_pleats((width / 2 - other, width / 2), height, depth, generator=generator))
    if generator.random() < 0.4:
        parts.append(block((-width / 2, width / 2), (-0.1, -0.06), (rail - 0.2, rail + 0.06)))
    made = join(*parts)
    return made if generator.random() < 0.5 else mirrored(made)


def _pleats(x: Span, height: Real, depth: Real, *, generator: np.random.Generator) -> Mesh:
    waves = generator.integers(3, 7)
    tie, strength = generator.uniform(0.3, 0.5), generator.choice([0.0, 0.0, 0.6])
    hem = generator.uniform(0, 0.06) * height
    u, v = np.meshgrid(np.linspace(0, 1, 6 * waves + 1), np.linspace(0, 1, 9), indexing="ij")
    gathered = 1 - strength * np.exp(-(((v - tie) / 0.2) ** 2))
    across = x[0] + (x[1] - x[0]) * u * gathered
    folds = depth * np.sin(2 * np.pi * waves * u + 0.5 * np.sin(3 * v)) * (1.2 - 0.4 * v) * gathered
    return sheet(np.stack([across, folds, hem + (height - hem) * v], axis=-1), (0, 0.008, 0))


def door(*, generator: np.random.Generator) -> Mesh:
    """A door ajar in its frame: panels or a window, lever handles, hinges on one side."""
    draw = generator.uniform
    width, height, thick = draw(0.75, 1.1), draw(1.95, 2.2), draw(0.035, 0.06)
    leaf = [block((0, width), (-thick / 2, thick / 2), (0.01, height))]
    leaf += _door_face(width, height, thick, style=int(generator.integers(4)))
    for side in (-1, 1):
        start = (width - 0.07, side * thick / 2, 1.02)
        end = (width - 0.07, side * (thick / 2 + 0.06), 1.02)
        leaf += [rod(start, end, 0.015), rod(end, (width - 0.2, end[1], 1.02), 0.012)]
        leaf.append(
            block((width - 0.1, width - 0.04), (start[1] - 0.006, start[1] + 0.006), (0.9, 1.12))
        )
    jamb, deep = draw(0.06, 0.14), draw(0.1, 0.2)
    frame = [
        block((-jamb, 0), (0, deep), (0, height + jamb)),
        block((width, width + jamb), (0, deep), (0, height + jamb)),
        block((0, width), (0, deep), (height, height + jamb)),
    ]
    frame += [
        rod((0, -thick / 2, at), (0, -thick / 2, at + 0.1), 0.015)
        for at in (0.2, 1.0, 0.85 * height)
    ]
    made = join(turn(join(*leaf), "z", -draw(5, 75)), *frame)
    return made if generator.random() < 0.5 else mirrored(made)


def _door_face(width: Real, height: Real, thick: Real, style: int) -> list[Mesh]:
    """What stands out of both faces of the door's leaf."""
    out = (-thick / 2 - 0.012, thick / 2 + 0.012)
    if style == 0:
        return [block((0.05, width - 0.05), out, (0.05, 0.3))]  # a kick plate
    if style == 1:
        rim = [(0.25, 0.5), (0.25, 0.85), (0.75, 0.85), (0.75, 0.5), (0.25, 0.5)]
        corners = [(a * width, 0, b * height) for a, b in rim]
        return [rod(a, b, 0.8 * thick) for a, b in pairwise(corners)]
    columns, rows = (1, 2) if style == 2 else (2, 3)
    x = np.linspace(0.06, width - 0.06, columns + 1).tolist()
    z = np.linspace(0.1, height - 0.06, rows + 1).tolist()
    return [
        block((a + 0.05, b - 0.05), out, (low + 0.06, high - 0.06))
        for a, b in pairwise(x)
        for low, high in pairwise(z)
    ]


def mantel(*, generator: np.random.Generator) -> Mesh:
    """A fireplace's surround: posts, lintel, stepped shelf, hearth, fire box and logs."""
    draw = generator.uniform
    width, height, depth = draw(1.2, 1.9), draw(1.0, 1.4), draw(0.15, 0.3)
    post, lintel, back = draw(0.15, 0.28), draw(0.18, 0.32), draw(0.25, 0.45)
    x, opening = (-width / 2, width / 2), height - lintel
    parts = [block(x, (-depth, 0), (opening, height))]
    for left in (x[0], x[1] - post):
        parts.append(block((left, left + post), (-depth, 0), (0, opening)))
        parts.append(block((left - 0.02, left + post + 0.02), (-depth - 0.02, 0), (0, 0.12)))
        if generator.random() < 0.6:
            middle = left + post / 2
            parts.append(
                rod((middle, -depth, 0.12), (middle, -depth, opening), 0.35 * post, 0.3 * post)
            )
    for step in range(int(generator.integers(1, 4))):
        out = 0.03 + 0.03 * step
        parts.append(
            block(
                (x[0] - out, x[1] + out),
                (-depth - out, 0),
                (height + 0.04 * step, height + 0.04 * step + 0.04),
            )
        )
    inner = (x[0] + post, x[1] - post)
    parts += [
        carcass(inner, (-0.02, back), (0, opening), 0.03),
        block((x[0] - 0.05, x[1] + 0.05), (-depth - draw(0.2, 0.45), 0), (-0.05, 0)),
        disc((draw(-0.1, 0.1), -depth - 0.01, height - lintel / 2), "y", 0.3 * lintel, 0.03),
    ]
    for log in range(int(generator.integers(1, 4))):
        start = (inner[0] + draw(0.1, 0.2), 0.1 + 0.05 * log, 0.09 + 0.05 * log)
        parts.append(rod(start, (inner[1] - draw(0.1, 0.3), 0.12, 0.09 + 0.05 * log), 0.05))
    return join(*parts)


def stairs(*, generator: np.random.Generator) -> Mesh:
    """Stairs with a rail: straight, or with a landing and a corner."""
    cornered = generator.random() < 0.5
    draw = generator.uniform
    width, rise, run = draw(0.8, 1.4), draw(0.15, 0.2), draw(0.24, 0.32)
    count = int(generator.integers(6, 13))
    solid = generator.random() < 0.6
    flight = _flight(count, width, rise, run, solid=solid, rails=int(generator.integers(1, 4)))
    if not cornered:
        return flight
    landing, end = count * rise, count * run
    floor = block(
        (-width / 2, width / 2),
        (end, end + width),
        (landing - 0.15 if solid else landing - 0.05, landing),
    )
    second = _flight(int(generator.integers(3, 7)), width, rise, run, solid=False, rails=1)
    side = 1 if generator.random() < 0.5 else -1
    second = move(turn(second, "z", -90 * side), (side * width / 2, end + width / 2, landing))
    post = block((-0.06, 0.06), (end + width - 0.12, end + width), (0, landing))
    return join(flight, floor, second, post)


def _flight(count: int, width: Real, rise: Real, run: Real, *, solid: bool, rails: int) -> Mesh:
    """Steps up towards +y; ``rails`` has bit 1 for the left rail, bit 2 for the right one."""
    x = (-width / 2, width / 2)
    parts = []
    for step in range(count):
        low = 0 if solid else (step + 1) * rise - 0.05
        parts.append(block(x, (step * run, (step + 1) * run + 0.02), (low, (step + 1) * rise)))
    if not solid:
        beam = [(0, 0), (0.2, 0), (count * run, count * rise - 0.1), (count * run, count * rise)]
        parts += [slab(beam, (at, at + 0.04), "x") for at in (x[0], x[1] - 0.04)]
    for bit, at in ((1, x[0] + 0.03), (2, x[1] - 0.03)):
        if rails & bit:
            ends = [((s + 0.5) * run, (s + 1) * rise) for s in range(0, count, 2)]
            parts += [rod((at, along, up), (at, along, up + 0.85), 0.015) for along, up in ends]
            first, last = ends[0], ends[-1]
            parts.append(rod((at, first[0], first[1] + 0.85), (at, last[0], last[1] + 0.85), 0.03))
    return join(*parts)


def tent(*, generator: np.random.Generator) -> Mesh:
    """A tent: ridge, dome, cone or tunnel, with a door flap, guy ropes and pegs."""
    draw = generator.uniform
    width, length, height = draw(1.4, 2.6), draw(1.8, 3.4), draw(1.0, 2.0)
    style = int(generator.integers(4))
    if style == 0:
        parts = [_ridge_tent(width, length, height, bow=draw(0, 0.12))]
    elif style == 1:
        s = np.linspace(0, np.pi / 2, 7)
        dome = lathe(np.column_stack([np.cos(s), np.sin(s)]), int(generator.choice([6, 8, 24])))
        parts = [stretch(dome, (width / 2, length / 2, height))]
    elif style == 2:
        sides = int(generator.integers(5, 10))
        wide = width / 2
        parts = [
            lathe([(wide, 0), (0.9 * wide, 0.1), (0.06, 1.3 * height), (0.05, 1.3 * height)], sides)
        ]
        parts += [
            turn(rod((0, 0, 1.2 * height), (0.2, 0, 1.55 * height), 0.02), "z", a)
            for a in (0, 90, 200)
        ]
    else:
        rows = [(a, draw(0.9, 1.0) if 0 < a < 5 else 0.75) for a in range(6)]
        rings = [_hoop(s * width, s * height, (a / 5 - 0.5) * length) for a, s in rows]
        parts = [skin(np.stack(rings))]
    half = {2: width / 2}.get(style, length / 2)
    flap = [(-0.3, 0.0), (0.3, 0.0), (0.0, 0.75 * height)]
    flap_made = move(slab(flap, (-0.02, 0), "y"), (0, -half, 0))
    parts.append(turn(flap_made, "z", draw(10, 40), about=(-0.3, -half, 0)))
    for angle in (45, 135, 225, 315):
        x, y = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        start, peg = (
            (0.35 * x * width, 0.35 * y * length, 0.4 * height),
            (0.75 * x * width, 0.75 * y * length, 0.0),
        )
        parts += [rod(start, peg, 0.008), rod(peg, (peg[0], peg[1], 0.12), 0.015)]
    return join(*parts)


def _hoop(width: Real, height: Real, y: Real) -> Float64[np.ndarray, "16 3"]:
    half = arc((0, 0, 0), 1.0, 0, 180, 16)
    return np.column_stack([half[:, 0] * width / 2, np.full(len(half), y), half[:, 1] * height])


def _ridge_tent(width: Real, length: Real, height: Real, bow: Real) -> Mesh:
    """Two sloping sheets, sagging by ``bow``, a ground sheet, two poles and a ridge pole."""
    s, t = np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 6), indexing="ij")
    sag = 4 * bow * t * (1 - t)
    side = np.stack(
        [(1 - t) * width / 2 - sag, (s - 0.5) * length, t * height - sag * 0.3], axis=-1
    )
    right = sheet(side, (-0.015, 0, -0.01))
    poles = [rod((0, at, 0), (0, at, 1.06 * height), 0.025) for at in (-length / 2, length / 2)]
    ground = block((-width / 2, width / 2), (-length / 2, length / 2), (-0.01, 0.01))
    gable = slab(
        [(-width / 2, 0), (width / 2, 0), (0, height)], (length / 2 - 0.02, length / 2), "y"
    )
    ridge = rod((0, -length / 2, height), (0, length / 2, height), 0.02)
    return join(right, stretch(right, (-1, 1, 1)), *poles, ground, gable, ridge)
