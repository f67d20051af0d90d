"""Made-up fixtures of kitchen and bathroom: bathtub, range_hood, sink, toilet."""

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    bar_handle,
    knob,
    tap,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
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


def bathtub(*, generator: np.random.Generator) -> Mesh:
    """A bath: hollow tub, sloped at the far end, taps at the other; on feet, or walled in."""
    draw = generator.uniform
    length, width, height = draw(1.4, 1.9), draw(0.65, 0.9), draw(0.45, 0.62)
    square, style = draw(2.2, 7.0), int(generator.integers(3))
    wall, slope = draw(0.04, 0.1), draw(0.1, 0.3)
    foot = 0.0 if style else draw(0.08, 0.15)
    taper = (0.8, 0.95, 1.0)[style]
    outside = [
        (taper, 0.0, foot),
        ((1 + taper) / 2, 0, 0.5 * height),
        (1, 0, 0.96 * height),
        (1.04, 0, height),
    ]
    rings = [oval((shift, 0, z), s * length, s * width, square, 32) for s, shift, z in outside]
    inner = (length - 2 * wall, width - 2 * wall)
    for depth, shrink in ((1.0, 1.0), (0.6, 0.92), (0.25, 0.8), (0.2, 0.6)):
        shift = slope * (1 - depth) / 2
        level = foot + depth * (height - foot)
        rings.append(
            oval((shift, 0, level), shrink * inner[0] - 2 * shift, shrink * inner[1], square, 32)
        )
    tub = np.stack(rings)  # its rim rises at the far end, to lean against
    tub[..., 2] *= 1 + draw(0.3, 0.6) * np.maximum(0, -2 * tub[..., 0] / length) ** 2
    end = length / 2
    parts = [
        skin(tub),
        tap((end - 0.5 * wall, 0, height), draw(0.12, 0.25), (-0.18, 0, 0)),
        *(disc((end - wall, s * 0.12, height + 0.04), "z", 0.025, 0.08, 10) for s in (-1, 1)),
        disc((end - 0.25 * length, 0, foot + 0.22 * (height - foot)), "z", 0.04, 0.01, 12),
    ]
    if style == 0:
        for side_x in (-1, 1):
            for side_y in (-1, 1):
                foot_at = (side_x * 0.36 * length, side_y * 0.3 * width, 0)
                parts.append(
                    rod(foot_at, (0.9 * foot_at[0], 0.8 * foot_at[1], foot + 0.08), 0.03, 0.05)
                )
    elif generator.random() < 0.6:  # a wall behind, or a step in front
        shelf = (width / 2, width / 2 + draw(0.1, 0.3))
        parts.append(block((-0.52 * length, 0.52 * length), shelf, (0, height + draw(-0.3, 0.1))))
    return join(*parts)


def range_hood(*, generator: np.random.Generator) -> Mesh:
    """A kitchen's hood: canopy, chimney at the wall, buttons and lamps below."""
    draw = generator.uniform
    width, depth, rim = draw(0.55, 1.0), draw(0.4, 0.55), draw(0.04, 0.12)
    x, y = (-width / 2, width / 2), (0.0, depth)
    flue, deep, tall = draw(0.2, 0.36), draw(0.18, 0.28), draw(0.4, 0.9)
    style, rise = int(generator.integers(3)), draw(0.15, 0.35)
    wall = [(x[0], 0.0), (x[1], 0.0), (x[1], depth), (x[0], depth)]
    pipe = [
        (-flue / 2, depth - deep),
        (flue / 2, depth - deep),
        (flue / 2, depth),
        (-flue / 2, depth),
    ]
    shares = {0: (0.0, 1.0), 1: (0.0, 0.55, 0.8, 0.93, 1.0), 2: (0.85, 0.95, 1.0)}[style]
    levels = np.linspace(rim, rim + (rise if style < 2 else 0.08), len(shares))
    rings = [
        np.column_stack([(1 - s) * np.array(wall) + s * np.array(pipe), np.full(4, z)])
        for s, z in zip(shares, levels.tolist(), strict=True)
    ]
    top = float(levels[-1])
    parts = [
        skin(np.stack(rings)),
        _canopy_rim(x, y, rim),
        block((-flue / 2, flue / 2), (depth - deep, depth), (top, top + tall)),
        block(
            (-flue / 2 - 0.01, flue / 2 + 0.01),
            (depth - deep - 0.01, depth),
            (top + 0.5 * tall, top + 0.52 * tall),
        ),
    ]
    first = draw(-0.35, 0.1) * width
    parts += [disc((first + 0.035 * k, 0, rim / 2), "y", 0.012, 0.012, 10) for k in range(4)]
    parts += [disc((s * 0.3 * width, 0.3 * depth, 0.01), "z", 0.04, 0.02, 14) for s in (-1, 1)]
    parts += [
        block((a, b), (0.15 * depth, 0.85 * depth), (0.015, 0.02))
        for a, b in ((0.45 * x[0], -0.01), (0.01, 0.45 * x[1]))
    ]
    if generator.random() < 0.4:
        parts.append(bar_handle((0.4 * x[0], 0, 0.2 * rim), (0.4 * x[1], 0, 0.2 * rim), 0.006))
    return join(*parts)


def _canopy_rim(x: Span, y: Span, height: Real) -> Mesh:
    """A low frame with a lid of grease filters: the bottom of a canopy."""
    return join(
        block(x, (y[0], y[0] + 0.015), (0, height)),
        block(x, (y[1] - 0.015, y[1]), (0, height)),
        *(block(side, y, (0, height)) for side in ((x[0], x[0] + 0.015), (x[1] - 0.015, x[1]))),
        block(x, y, (0.02, 0.03)),
    )


def sink(*, generator: np.random.Generator) -> Mesh:
    """A sink: one basin on a pedestal, or one or two in a counter; a tap behind."""
    draw = generator.uniform
    if generator.random() < 0.4:
        width, depth, rim = draw(0.45, 0.65), draw(0.4, 0.5), draw(0.75, 0.9)
        parts = [
            _basin((0, 0), (width, depth), (rim - 0.2, rim), draw(2.0, 5.0)),
            lathe(smooth([(0.16, 0), (0.1, 0.1), (0.08, 0.5 * rim), (0.14, rim - 0.15)], 10)),
            block(
                (-0.45 * width, 0.45 * width),
                (0.4 * depth, 0.56 * depth),
                (rim - 0.14, rim + draw(0, 0.1)),
            ),
        ]
        return join(*parts, tap((0, 0.48 * depth, rim), draw(0.15, 0.3), (0, -0.16, 0)))
    depth, rim, first = draw(0.42, 0.55), draw(0.15, 0.3), draw(0.35, 0.55)
    second = draw(0.2, 0.35) if generator.random() < 0.5 else 0.0
    square = draw(4, 9)
    parts = [_basin((first / 2, 0), (first, depth), (0, rim), square)]
    if second:
        parts.append(_basin((first + second / 2, 0), (second, depth), (0.3 * rim, rim), square))
    end = first + second
    if generator.random() < 0.6:  # a ribbed board to drain on
        board = draw(0.25, 0.5)
        parts.append(block((-board, 0), (-depth / 2, depth / 2), (rim - 0.02, rim - 0.01)))
        ribs = np.linspace(-board, 0, 7)[1:-1].tolist()
        parts += [
            block((at, at + 0.01), (-0.4 * depth, 0.4 * depth), (rim - 0.01, rim)) for at in ribs
        ]
    ledge = (depth / 2 - 0.01, depth / 2 + 0.09)
    parts.append(block((0, end), ledge, (rim - 0.03, rim + 0.005)))
    at = draw(0.35, 0.65) * end
    return join(*parts, tap((at, depth / 2 + 0.04, rim), draw(0.2, 0.4), (0, -0.22, 0)))


def _basin(
    centre: tuple[Real, Real], size: tuple[Real, Real], z: tuple[Real, Real], square: Real
) -> Mesh:
    x, y = centre
    width, depth = size
    tall = z[1] - z[0]
    rows = [(0.7, 0.0), (0.92, 0.6), (1.0, 1.0), (0.88, 1.0), (0.8, 0.5), (0.6, 0.15), (0.1, 0.12)]
    rings = [oval((x, y, z[0] + h * tall), s * width, s * depth, square, 28) for s, h in rows]
    pipe = rod((x, y, z[0] - 0.12), (x, y, z[0]), 0.03)
    return join(skin(np.stack(rings)), pipe)


def toilet(*, generator: np.random.Generator) -> Mesh:
    """A toilet: foot, hollow bowl, seat, lid up or down, tank with lever."""
    draw = generator.uniform
    width, length, height = draw(0.34, 0.42), draw(0.42, 0.55), draw(0.36, 0.45)
    outside = [(0.6, 0.75, 0, 0.1), (0.5, 0.6, 0.35, 0.1), (0.95, 0.95, 0.85, 0), (1, 1, 1, 0)]
    inside = [(0.8, 0.84, 1, 0), (0.7, 0.74, 0.8, 0), (0.35, 0.35, 0.5, 0.1)]
    rings = [
        oval((0, shift * length, z * height), w * width, d * length, squareness=2.4)
        for w, d, z, shift in outside + inside
    ]
    back = 0.5 * length
    tank = (height + draw(0.0, 0.06), height + draw(0.32, 0.42))
    half = draw(0.9, 1.15) * width / 2
    wall = (back - 0.04, back + draw(0.14, 0.2))
    lid = stretch(disc((0, 0, 0), "z", 0.5, 1), (width * 1.02, length * 1.02, 0.025))
    lid = move(lid, (0, 0, height + 0.035))
    opening = draw(85, 100) if generator.random() < 0.5 else 0
    lever = (-half + 0.06 if generator.random() < 0.5 else half - 0.06, wall[0], tank[1] - 0.06)
    return join(
        skin(np.stack(rings)),
        _toilet_seat(width, length, height + 0.01),
        turn(lid, "x", -opening, about=(0, 0.48 * length, height + 0.03)),
        cushion((-half, half), wall, tank, squareness=7),
        block((-half - 0.015, half + 0.015), (wall[0] - 0.015, wall[1]), (tank[1], tank[1] + 0.03)),
        block((-0.3 * width, 0.3 * width), (0.3 * length, wall[1]), (0.5 * height, tank[0] + 0.02)),
        knob(lever, 0.015),
        rod(
            (lever[0], lever[1] - 0.025, lever[2]),
            (lever[0] * 0.5, lever[1] - 0.03, lever[2] - 0.02),
            0.01,
        ),
        ball((0, wall[1] - 0.03, 0.15), (0.05, 0.05, 0.05), sides=8),
    )


def _toilet_seat(width: Real, length: Real, height: Real) -> Mesh:
    ring = oval((0, 0, height), 0.92 * width, 0.94 * length)
    return tube(np.vstack([ring, ring[:2]]), 0.022, sides=6)
