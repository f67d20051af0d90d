"""Parts that several objects share: legs and other stands, fronts with handles, leaves, taps."""

from typing import Literal

import numpy as np

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.solids import (
    Real,
    Vector,
    ball,
    both_sides,
    boxes,
    disc,
    four,
    join,
    lathe,
    place,
    rod,
    sheet,
    tube,
    turn,
)

Stand = Literal["square", "round", "splayed", "pedestal", "trestle", "star", "runners"]
LEGS: tuple[Stand, ...] = ("square", "round", "splayed")


def stand(style: Stand, width: Real, depth: Real, height: Real, thickness: Real) -> Mesh:
    """What carries a seat, top or body whose underside is at ``height``, about the z axis."""
    x, y = (width - thickness) / 2, (depth - thickness) / 2
    if style == "pedestal":
        foot = 0.35 * min(width, depth)
        knots = [(foot, 0), (foot, 0.03), (thickness, 0.08), (thickness, height - 0.02)]
        return lathe([*knots, (1.5 * thickness, height)])
    if style == "star":
        arm = join(
            rod((0, 0, 0.12), (x, 0, 0.07), 0.025, 0.015), disc("x", 0.03, 0.03, (x, 0, 0.03))
        )
        arms = (turn(arm, "z", angle) for angle in range(0, 360, 72))
        return join(rod((0, 0, 0.1), (0, 0, height), thickness), *arms)
    if style == "trestle":
        leg = rod((x, y, 0), (x, -0.3 * y, height), thickness / 2)
        bar = rod((-x, 0, 0.4 * height), (x, 0, 0.4 * height), thickness / 3)
        return join(four(leg), bar)
    if style == "runners":
        loop = [(x, y, 0.02), (x, -y, 0.02), (x, 0.03 - y, height), (x, y - 0.1, height)]
        back = rod((-x, y, 0.02), (x, y, 0.02), thickness / 3)
        return join(both_sides(tube(loop, thickness / 3)), back)
    if style == "square":
        return four(boxes((thickness, thickness, height, x, y, 0)))
    out = 0.2 * height if style == "splayed" else 0.0
    return four(rod((x + out, y + out, 0), (x, y, height), 0.35 * thickness, thickness / 2))


def knob(at: Vector, radius: Real) -> Mesh:
    """A round knob that sticks out of a front (towards -y)."""
    x, y, z = at
    stem = rod((x, y, z), (x, y - radius, z), 0.5 * radius)
    return join(stem, ball((radius, radius, radius), (x, y - 1.6 * radius, z), sides=6))


def handle(start: Vector, end: Vector) -> Mesh:
    """A bar on two posts in front of a front."""
    (x, y, z), (last_x, _, last_z) = start, end
    path = [(x, y, z), (x, y - 0.03, z), (last_x, y - 0.03, last_z), (last_x, y, last_z)]
    return tube(path, 0.008)


def drawers(width: Real, height: Real, count: int, draw: Draw) -> Mesh:
    """A stack of drawers before the plane y = 0, one of them pulled out a little."""
    each, style, pulled = height / count, draw.whole(0, 2), draw.whole(0, count - 1)
    front, out, z = boxes((0.96 * width, 0.02, 0.94 * each, 0, -0.01, 0)), draw(0.05, 0.2), each / 2
    grips = (
        knob((0, -0.02, z), 0.02),
        handle((-0.12 * width, -0.02, z), (0.12 * width, -0.02, z)),
        both_sides(knob((0.25 * width, -0.02, z), 0.018)),
    )
    front = join(front, grips[style])
    made = [place(front, (0, -out if n == pulled else 0, n * each)) for n in range(count)]
    return join(*made, boxes((0.9 * width, out, 0.6 * each, 0, -out / 2, (pulled + 0.1) * each)))


def carcass(width: Real, depth: Real, height: Real, board: Real) -> Mesh:
    """A cabinet without a front on z = 0, about the z axis: bottom, top, two sides and a back."""
    side = (width - board) / 2
    return boxes(
        *((width, depth, board, 0, 0, z) for z in (0, height - board)),
        *((board, depth, height, x, 0, 0) for x in (-side, side)),
        (width, board, height, 0, (depth - board) / 2, 0),
    )


def leaf(base: Vector, tip: Vector, width: Real, droop: Real, steps: int = 6) -> Mesh:
    """A pointed leaf from ``base`` to ``tip``, its middle lifted by ``droop``."""
    s = np.linspace(0, 1, steps)[:, None]
    start, end = np.asarray(base, dtype=np.float64), np.asarray(tip, dtype=np.float64)
    spine = start + s * (end - start) + np.array([0, 0, 4 * droop]) * s * (1 - s)
    across = np.array([start[1] - end[1], end[0] - start[0], 0])
    half = width / 2 * np.sin(np.pi * (0.08 + 0.9 * s)) * across / np.linalg.norm(across)
    fold = np.array([0, 0, 0.25 * width]) * np.sin(np.pi * s)
    blade = np.stack([spine - half + fold, spine, spine + half + fold], axis=1)
    return sheet(blade, (0, 0, 0.01 * width))


def tap(height: Real, reach: Real) -> Mesh:
    """A water tap on the origin: up, over and down towards -y, with a lever to the right."""
    path = [(0, 0), (0, 0.8), (-0.3, 1), (-1, 0.95), (-1, 0.7)]
    spout = tube([(0, along * reach, up * height) for along, up in path], 0.07 * height)
    lever = rod((0, 0, 0.7 * height), (0.35 * height, 0, height), 0.04 * height)
    return join(spout, lever)


def spaced(low: Real, high: Real, count: int) -> list[float]:
    """Evenly spaced numbers, both ends among them."""
    numbers: list[float] = np.linspace(low, high, count).tolist()
    return numbers
