"""Made-up plants in pots: flower_pot, plant; the flowers of a vase too."""

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    hollow,
    leaf,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Vector,
    ball,
    join,
    lathe,
    move,
    rod,
    tube,
    turn,
)


def flower_pot(*, generator: np.random.Generator) -> Mesh:
    """A wide pot with some short flowers."""
    draw = generator.uniform
    radius, height = draw(0.1, 0.2), draw(0.12, 0.26)
    parts = [_pot(radius, height, generator=generator)]
    for _ in range(int(generator.integers(3, 8))):
        at = draw(-0.5, 0.5, 2) * radius
        base = (float(at[0]), float(at[1]), 0.75 * height)
        parts.append(
            flower(base, draw(0.6, 1.2) * height, draw(0.12, 0.22) * radius, generator=generator)
        )
    if generator.random() < 0.5:
        parts.append(lathe([(0.8 * radius, -0.02), (1.15 * radius, 0.01), (1.15 * radius, 0.02)]))
    return join(*parts)


def plant(*, generator: np.random.Generator) -> Mesh:
    """A tall plant in a small pot: palm, upright blades, or a bush on a branching stem."""
    draw = generator.uniform
    radius, height = draw(0.1, 0.16), draw(0.12, 0.24)
    tall = draw(0.5, 1.3)
    style = int(generator.integers(3))
    parts = [_pot(radius, height, generator=generator)]
    leaves = int(generator.integers(9, 20))
    trunk = draw(0.3, 0.6) * tall if style else 0.0
    bend = draw(-0.2, 0.2, 2) * trunk
    crown = (float(bend[0]), float(bend[1]), height + trunk)
    if style:
        middle = (0.2 * crown[0], 0.2 * crown[1], height + 0.5 * trunk)
        parts.append(tube([(0, 0, 0.7 * height), middle, crown], [0.03, 0.025, 0.018]))
    for number in range(leaves):
        heading = number * 137.5 + draw(-25, 25)
        parts.append(
            turn(_frond(style, crown, tall, trunk, generator=generator), "z", heading, crown)
        )
    return join(*parts)


def _frond(
    style: int, crown: Vector, tall: Real, trunk: Real, *, generator: np.random.Generator
) -> Mesh:
    draw = generator.uniform
    x, y, z = crown
    if style == 0:  # blades that rise from the pot
        length = draw(0.5, 1.0) * tall
        return leaf(
            (x + 0.02, y, z - 0.05), (x + draw(0.1, 0.35) * length, y, z + length), 0.09, 0, 7
        )
    if style == 1:  # fronds that hang from the crown
        length = draw(0.35, 0.6) * tall
        return leaf(
            crown, (x + length, y, z - draw(0.0, 0.4) * length), 0.16 * length, 0.25 * length, 8
        )
    twig_end = (x + draw(0.08, 0.25) * tall, y, z + draw(-0.5, 0.35) * trunk)
    size = draw(0.12, 0.2) * tall
    tip = (twig_end[0] + size, y, twig_end[2] + draw(-0.3, 0.3) * size)
    twig = rod((0.4 * x, 0.4 * y, z - 0.4 * trunk), twig_end, 0.008)
    return join(twig, leaf(twig_end, tip, 0.7 * size, 0.1 * size))


def _pot(radius: Real, height: Real, *, generator: np.random.Generator) -> Mesh:
    """A tapered pot with a rim, filled with earth; round or square."""
    foot, rim = generator.uniform(0.55, 0.85), generator.uniform(1.05, 1.2)
    outside = [
        (foot * radius, 0),
        (radius, 0.82 * height),
        (rim * radius, 0.82 * height),
        (rim * radius, height),
    ]
    sides = 4 if generator.random() < 0.2 else 24
    made = hollow(outside, 0.15 * radius, 0.75 * height, sides)
    return turn(made, "z", 45) if sides == 4 else made


def flower(base: Vector, length: Real, head: Real, *, generator: np.random.Generator) -> Mesh:
    """A stem that leans somewhere, with a petalled head."""
    lean, heading = generator.uniform(0.05, 0.35), generator.uniform(0, 360)
    steps = np.linspace(0, 1, 5)
    stem = np.column_stack([lean * steps**2, 0 * steps, steps]) * length
    top: Vector = (float(stem[-1, 0]), 0, float(stem[-1, 2]))
    petals = [
        turn(
            leaf(top, (top[0] + 2 * head, 0, top[2] + 0.3 * head), head, 0.1 * head, steps=4),
            "z",
            angle,
            top,
        )
        for angle in range(0, 360, 72)
    ]
    flower = join(
        tube(stem, 0.12 * head, sides=5),
        ball(top, (head / 2, head / 2, head / 2), sides=6),
        *petals,
    )
    return move(turn(flower, "z", heading), base)
