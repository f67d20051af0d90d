"""Made-up things turned on a wheel: bottle, bowl, cone, cup, lamp, vase."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    hollow,
)
from pipeline.synthetic.shapes.plants import flower
from pipeline.synthetic.shapes.solids import (
    Vector,
    ball,
    block,
    disc,
    hoop,
    join,
    lathe,
    move,
    rod,
    smooth,
    stretch,
    tube,
    turn,
)


def bottle(*, generator: np.random.Generator) -> Mesh:
    """A bottle or flask: body, shoulder, neck, lip, cap; round or flattened."""
    draw = generator.uniform
    radius, height = draw(0.03, 0.06), draw(0.18, 0.34)
    neck, shoulder, collar = draw(0.25, 0.5) * radius, draw(0.4, 0.75), draw(0.78, 0.92)
    foot = draw(0.7, 1.0) * radius
    knots = [
        (foot, 0),
        (radius, 0.06 * height),
        (draw(0.85, 1.1) * radius, 0.5 * shoulder * height),
        (radius, shoulder * height),
        (neck, collar * height),
        (neck, height),
    ]
    lip = draw(1.1, 1.4) * neck
    ring = [(lip, 0.965 * height), (lip, height)]
    parts = [lathe(np.vstack([smooth(knots, 22)[:-1], [[neck, 0.96 * height]], ring]))]
    if generator.random() < 0.5:
        parts.append(disc((0, 0, height + 0.3 * neck), "z", 1.1 * lip, draw(0.6, 1.5) * neck, 16))
    if generator.random() < 0.5:
        band = disc(
            (0, 0, 0.4 * shoulder * height), "z", 1.06 * radius, draw(0.2, 0.5) * shoulder * height
        )
        parts.append(band)
    return stretch(join(*parts), (1, draw(0.55, 0.8) if generator.random() < 0.25 else 1, 1))


def bowl(*, generator: np.random.Generator) -> Mesh:
    """A bowl, deep or shallow, on a foot or not, its rim straight or turned out."""
    draw = generator.uniform
    radius, height, foot = draw(0.07, 0.16), draw(0.04, 0.1), draw(0.3, 0.6)
    curve, flare = draw(0.3, 0.8), draw(0.9, 1.15)
    s = np.linspace(0, 1, 14)
    stand = draw(0.0, 0.02)
    profile = np.column_stack([radius * (foot + (1 - foot) * s**curve), stand + height * s**1.3])
    profile[-1, 0] *= flare
    made = hollow(profile, 0.06 * radius, stand + 0.12 * height, sides=32)
    if stand < 0.005:
        return made
    return join(made, lathe([(0.9 * foot * radius, 0), (0.8 * foot * radius, stand + 0.01)], 32))


def cone(*, generator: np.random.Generator) -> Mesh:
    """A cone: of the road, with a square foot and bands; bare; or upside down, for ice cream."""
    draw = generator.uniform
    radius, height = draw(0.12, 0.3), draw(0.35, 0.9)
    style = int(generator.integers(3))
    tip = draw(0.02, 0.2) * radius if style < 2 else 0.01
    levels = np.linspace(0, 1, 10)
    profile = np.column_stack([radius + (tip - radius) * levels, height * levels])
    if style == 0:
        half = draw(1.15, 1.5) * radius
        bands = [
            profile[3] + [0.01, 0],
            profile[4] + [0.01, 0],
            profile[6] + [0.01, 0],
            profile[7] + [0.01, 0],
        ]
        foot = block((-half, half), (-half, half), (-draw(0.02, 0.05), 0))
        return join(lathe(profile), lathe(np.stack(bands[:2])), lathe(np.stack(bands[2:])), foot)
    if style == 1:
        rim = draw(1.0, 1.3) * radius
        return join(lathe(profile), lathe([(rim, -0.02), (rim, 0)]))
    scoop = ball((0, 0, height), (radius, radius, draw(0.8, 1.1) * radius), sides=20)
    return join(lathe(profile[::-1] * [1, -1] + [0, height]), scoop)


def cup(*, generator: np.random.Generator) -> Mesh:
    """A cup with a handle, straight, tapered or bellied, on a saucer or not."""
    draw = generator.uniform
    radius, height, foot = draw(0.03, 0.05), draw(0.06, 0.12), draw(0.6, 1.0)
    belly = draw(0.85, 1.15)
    knots = [
        (foot * radius, 0),
        (belly * 0.5 * (1 + foot) * radius, 0.45 * height),
        (radius, height),
    ]
    start, reach = 0.95 * 0.5 * (1 + foot) * belly * radius, radius * draw(0.5, 0.8)
    low, high = 0.25 * height, 0.8 * height
    swing = np.deg2rad(np.linspace(-90, 90, 9))
    loop = np.column_stack(
        [
            start + reach * np.cos(swing),
            0 * swing,
            (low + high) / 2 + (high - low) / 2 * np.sin(swing),
        ]
    )
    parts = [
        hollow(smooth(knots, 14), 0.09 * radius, 0.06 * height),
        tube(loop, draw(0.08, 0.16) * radius),
    ]
    if generator.random() < 0.4:
        wide = draw(1.5, 2.0) * radius
        parts.append(hollow([(0.5 * wide, -0.012), (wide, 0.0), (wide, 0.004)], 0.1 * wide, -0.01))
    return join(*parts)


def lamp(*, generator: np.random.Generator) -> Mesh:
    """A lamp: on a table, on the floor, or on a jointed arm."""
    draw = generator.uniform
    style = int(generator.integers(3))
    foot, shade = draw(0.08, 0.16), draw(0.1, 0.2)
    height = (draw(0.3, 0.5), draw(1.2, 1.7), draw(0.35, 0.5))[style]
    foot = foot * (1.4 if style == 1 else 1)
    base = lathe([(foot, 0), (foot, 0.02), (draw(0.3, 0.9) * foot, 0.035), (0.012, 0.05)])
    narrow, tall = draw(0.4, 0.95) * shade, draw(0.8, 1.6) * shade
    hood = hoop([(shade, 0), (narrow, tall), (narrow - 0.006, tall), (shade - 0.006, 0)])
    if style == 2:
        elbow, end = (-0.4 * height, 0, height), (0.4 * height, 0, 1.4 * height)
        head = move(turn(stretch(hood, (0.6, 0.6, 0.6)), "y", draw(-50, -10)), end)
        return join(
            base,
            rod((0, 0, 0.03), elbow, 0.012),
            rod(elbow, end, 0.01),
            ball(elbow, (0.02, 0.02, 0.02)),
            head,
        )
    body = [
        (0.012, 0.05),
        (draw(0.012, 0.1), 0.3 * height),
        (draw(0.012, 0.05), 0.6 * height),
        (0.012, height),
    ]
    post = lathe(smooth(body, 14) if style == 0 else [(0.014, 0.04), (0.012, height)], 16)
    spokes = [
        turn(rod((0, 0, height), (narrow, 0, height + 0.9 * tall), 0.004), "z", a)
        for a in (0, 120, 240)
    ]
    bulb = ball((0, 0, height + 0.3 * tall), (0.03, 0.03, 0.045), sides=10)
    return join(base, post, bulb, *spokes, move(hood, (0, 0, height - 0.1 * tall)))


def vase(*, generator: np.random.Generator) -> Mesh:
    """A vase: a belly and a waist anywhere, round or many-sided, with ears or without."""
    draw = generator.uniform
    height, radius = draw(0.2, 0.5), draw(0.06, 0.13)
    knots = [
        (draw(0.4, 0.8) * radius, 0),
        (draw(0.8, 1.2) * radius, draw(0.2, 0.35) * height),
        (draw(0.6, 1.1) * radius, draw(0.5, 0.65) * height),
        (draw(0.25, 0.5) * radius, draw(0.75, 0.85) * height),
        (draw(0.4, 0.9) * radius, height),
    ]
    profile = smooth(knots, 18)
    sides = int(generator.choice([6, 8, 24, 24]))
    parts = [hollow(profile, 0.06 * radius, 0.05 * height, sides)]
    if generator.random() < 0.35:
        neck, side = knots[3], knots[2]
        for angle in (0, 180):
            loop = [
                (neck[0], 0, neck[1]),
                (neck[0] + 0.6 * radius, 0, neck[1]),
                (side[0], 0, side[1]),
            ]
            parts.append(turn(tube(_ear(loop), 0.08 * radius), "z", angle))
    if generator.random() < 0.3:
        stems = int(generator.integers(2, 5))
        parts += [
            flower((0, 0, 0.4 * height), 0.9 * height, 0.3 * radius, generator=generator)
            for _ in range(stems)
        ]
    return join(*parts)


def _ear(points: Sequence[Vector], count: int = 8) -> Float64[np.ndarray, "count 3"]:
    """A rounded path through points in the plane y = 0."""
    flat = smooth([(x, z) for x, _, z in points], count)
    return np.insert(flat, 1, 0, axis=1)
