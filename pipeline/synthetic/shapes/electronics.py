"""Made-up things with a processor: keyboard, laptop, monitor, xbox."""

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
    ball,
    block,
    cushion,
    disc,
    join,
    move,
    oval,
    rod,
    skin,
    stretch,
    tube,
    turn,
)


def keyboard(*, generator: np.random.Generator) -> Mesh:
    """A keyboard: a sloped board, rows of keys, space bar, arrows, a pad of numbers or not."""
    draw = generator.uniform
    pitch, rows = draw(0.017, 0.02), int(generator.integers(5, 7))
    pad = int(generator.integers(0, 5))
    key, rise = draw(0.004, 0.011), draw(2, 9)
    width, depth = (15 + (pad + 0.6 if pad else 0)) * pitch, rows * pitch
    parts = [
        cushion(
            (-0.5 * pitch, width + 0.5 * pitch), (-0.5 * pitch, depth + 0.6 * pitch), (-0.014, 0), 9
        )
    ]
    for row in range(1, rows):
        shift = (0.5, 0.75, 0.25, 0, 0)[row - 1]
        keys = (np.arange(13 + int(row > 2)) + shift).tolist()
        keys += (15.6 + np.arange(pad)).tolist()
        parts += [
            _key((at * pitch, (at + 1) * pitch), (row * pitch, (row + 1) * pitch), key)
            for at in keys
        ]
    for left, right in ((0, 1.5), (1.5, 3), (3.2, 9.5), (9.7, 11), (12, 13), (13, 14), (14, 15)):
        parts.append(_key((left * pitch, right * pitch), (0, pitch), key))
    if pad:
        parts.append(_key((15.6 * pitch, 17.6 * pitch), (0, pitch), key))
    if generator.random() < 0.35:
        rest = draw(0.05, 0.08)
        parts.append(
            cushion((-0.5 * pitch, width), (-0.5 * pitch - rest, -0.5 * pitch), (-0.014, -0.002), 7)
        )
    parts += [
        block((at * width, at * width + 0.03), (depth - 0.01, depth), (-0.03, -0.014))
        for at in (0.1, 0.85)
    ]
    return turn(join(*parts), "x", rise)


def _key(x: Span, y: Span, height: Real) -> Mesh:
    gap = 0.0012
    return block((x[0] + gap, x[1] - gap), (y[0] + gap, y[1] - gap), (0, height), taper=0.8)


def laptop(*, generator: np.random.Generator) -> Mesh:
    """A laptop, opened: keys, touch pad, hinges, screen."""
    draw = generator.uniform
    width, depth, thick = draw(0.29, 0.4), draw(0.2, 0.27), draw(0.012, 0.028)
    x, columns, rows = (-width / 2, width / 2), int(generator.integers(11, 15)), 5
    far, near = draw(0.85, 0.9) * depth, draw(0.4, 0.46) * depth
    across, along = 0.9 * width / columns, (far - near) / rows
    base = cushion(x, (0, depth), (0, thick), 10)
    keys = [
        _key(
            (x[0] + 0.05 * width + c * across, x[0] + 0.05 * width + (c + 1) * across),
            (near + r * along, near + (r + 1) * along),
            0.004,
        )
        for r in range(rows)
        for c in range(columns)
        if not (r == 0 and 3 <= c < 8)
    ]
    space = _key(
        (x[0] + 0.05 * width + 3 * across, x[0] + 0.05 * width + 8 * across),
        (near, near + along),
        0.004,
    )
    board = move(join(space, *keys), (0, 0, thick))
    pad = block((-0.16 * width, 0.14 * width), (0.06 * depth, 0.34 * depth), (thick, thick + 0.002))
    lid_thick = draw(0.005, 0.012)
    lid = join(
        block(x, (depth, depth + lid_thick), (thick, thick + depth)),
        block(
            (x[0] + 0.01, x[1] - 0.01),
            (depth - 0.002, depth),
            (thick + 0.015, thick + depth - 0.01),
        ),
        disc((0, depth + lid_thick, thick + 0.5 * depth), "y", 0.02, 0.004, 12),
    )
    lid = turn(lid, "x", -draw(-5, 45), about=(0, depth, thick))
    hinges = [
        rod((at, depth, thick), (at + 0.05, depth, thick), 0.007)
        for at in (x[0] + 0.03, x[1] - 0.08)
    ]
    ports = [
        block((x[0] - 0.004, x[0]), (y * depth, y * depth + 0.015), (0.3 * thick, 0.8 * thick))
        for y in (0.4, 0.6, 0.8)
    ]
    return join(base, board, pad, lid, *hinges, *ports)


def monitor(*, generator: np.random.Generator) -> Mesh:
    """A monitor: a flat screen on a foot, or a deep tube; bezel, buttons, plugs."""
    draw = generator.uniform
    width = draw(0.4, 0.75)
    height, lift, bezel = width * draw(0.5, 0.8), draw(0.06, 0.16), draw(0.01, 0.03)
    x, z = (-width / 2, width / 2), (lift, lift + height)
    deep = draw(0.25, 0.4) if generator.random() < 0.3 else draw(0.03, 0.08)
    screen = [
        block(x, (-0.02, 0.01), z),
        skin(_back_rings(width, height, deep, lift + height / 2)),
        block((x[0], x[1]), (-0.03, -0.02), (z[0], z[0] + 1.6 * bezel)),
        block((x[0], x[1]), (-0.03, -0.02), (z[1] - bezel, z[1])),
        *(block(side, (-0.03, -0.02), z) for side in ((x[0], x[0] + bezel), (x[1] - bezel, x[1]))),
        *(
            disc((x[1] - 0.05 - 0.03 * k, -0.03, z[0] + bezel), "y", 0.008, 0.008, 8)
            for k in range(3)
        ),
        *(
            block(
                (0.1 * width, 0.14 * width),
                (deep, deep + 0.02),
                (z[0] + s * height, z[0] + s * height + 0.02),
            )
            for s in (0.3, 0.4)
        ),
    ]
    tilted = turn(join(*screen), "x", -draw(-2, 12), about=(0, 0, lift))
    style, back = int(generator.integers(3)), draw(0.02, 0.07)
    neck = rod((0, back + 0.03, 0.01), (0, 0.03, lift + 0.3 * height), draw(0.02, 0.04))
    if style == 0:
        foot = stretch(disc((0, 0, 0), "z", 1, 1, 24), (0.3 * width, draw(0.1, 0.14), 0.02))
    elif style == 1:
        foot = block((-0.25 * width, 0.25 * width), (-0.1, 0.1), (-0.01, 0.01))
    else:
        foot = join(*(rod((0, 0, 0.01), (s * 0.35 * width, -0.14, 0), 0.015) for s in (-1, 1)))
    return join(tilted, neck, move(foot, (0, back + 0.02, 0)))


def _back_rings(
    width: Real, height: Real, deep: Real, middle: Real
) -> Float64[np.ndarray, "3 20 3"]:
    rings = [oval((0, 0, 0), s * width, s * height, 8, 20) for s in (0.96, 0.9, 0.5)]
    stood = [
        np.column_stack([r[:, 0], np.full(20, y), r[:, 1] + middle])
        for r, y in zip(rings, (0.01, 0.4 * deep, deep), strict=True)
    ]
    return np.stack(stood)


def xbox(*, generator: np.random.Generator) -> Mesh:
    """A game console, lying or standing, with disc slot, vents, plugs; its controller in front."""
    draw = generator.uniform
    width, depth, height = draw(0.26, 0.34), draw(0.22, 0.3), draw(0.05, 0.09)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    front = y[0]
    style = int(generator.integers(3))
    waist = (1.0, 0.9, 0.95)[style]
    rows = [(0.98, 0.0), (1.0, 0.1), (waist, 0.5), (1.0, 0.9), (0.98, 1.0)]
    rings = [oval((0, 0, h * height), s * width, s * depth, (9, 5, 12)[style], 28) for s, h in rows]
    slots = [
        block(
            (x[0] + 0.03 + 0.03 * k, x[0] + 0.04 + 0.03 * k),
            (0.1 * depth, 0.4 * depth),
            (height, height + 0.006),
        )
        for k in range(4)
    ]
    console = [
        skin(np.stack(rings)),
        block(
            (x[0] + 0.04, 0.1 * width), (front - 0.004, front + 0.03), (0.6 * height, 0.7 * height)
        ),
        disc((0.36 * width, front, 0.5 * height), "y", 0.02, 0.012, 16),
        *(
            block(
                (0.15 * width + 0.03 * k, 0.2 * width + 0.03 * k),
                (front - 0.003, front + 0.03),
                (0.2 * height, 0.3 * height),
            )
            for k in (-2, -1, 0)
        ),
        *(
            block((at, at + 0.02), (y[1] - 0.01, y[1] + 0.006), (0.3 * height, 0.6 * height))
            for at in (-0.1, -0.06, 0.02)
        ),
        *slots,
    ]
    if style != 1:
        console.append(disc((0.15 * width, -0.1 * depth, height), "z", 0.05, 0.012, 20))
    made = join(*console)
    if generator.random() < 0.35:
        made = turn(made, "y", -90, about=(0, 0, 0))
    pad = move(
        turn(_controller(draw(0.9, 1.2)), "z", draw(-40, 40)),
        (draw(-0.1, 0.12), front - draw(0.1, 0.16), -0.0),
    )
    low = float(made.vertices[:, 2].min())
    return join(move(made, (0, 0, -low)), pad)


def _controller(size: Real) -> Mesh:
    body = cushion((-0.07, 0.07), (-0.035, 0.04), (0.01, 0.045), 3)
    grips = [
        tube(
            [(s * 0.05, 0.0, 0.03), (s * 0.075, -0.05, 0.02), (s * 0.07, -0.085, 0.015)],
            [0.028, 0.022, 0.014],
        )
        for s in (-1, 1)
    ]
    sticks = [rod((a, b, 0.04), (a, b, 0.062), 0.012) for a, b in ((-0.04, 0.012), (0.02, -0.015))]
    buttons = [
        ball((0.042 + a, 0.012 + b, 0.047), (0.006, 0.006, 0.006), 6)
        for a, b in ((0.012, 0), (-0.012, 0), (0, 0.012), (0, -0.012))
    ]
    return stretch(join(body, *grips, *sticks, *buttons), (size, size, size))
