"""Parts that several made-up objects share: legs, fronts, handles, leaves, taps, vessels."""

from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.solids import (
    Outline,
    Real,
    Span,
    Vector,
    ball,
    block,
    join,
    lathe,
    rod,
    sheet,
    tube,
)

LegStyle = Literal["square", "round", "splayed"]
Handle = Literal["knob", "bar", "two knobs"]
HANDLES: tuple[Handle, ...] = ("knob", "bar", "two knobs")
LEG_STYLES: tuple[LegStyle, ...] = ("square", "round", "splayed")


def legs(x: Span, y: Span, z: Span, thickness: Real, style: LegStyle) -> Mesh:
    """Four legs under the corners of a rectangle, from ``z[0]`` up to ``z[1]``."""
    half = thickness / 2
    splay = 0.2 * (z[1] - z[0]) if style == "splayed" else 0.0
    made = []
    for corner_x, side_x in ((x[0] + half, -1), (x[1] - half, 1)):
        for corner_y, side_y in ((y[0] + half, -1), (y[1] - half, 1)):
            if style == "square":
                around_x, around_y = (
                    (corner_x - half, corner_x + half),
                    (corner_y - half, corner_y + half),
                )
                made.append(block(around_x, around_y, z))
            else:
                foot = (corner_x + side_x * splay, corner_y + side_y * splay, z[0])
                made.append(rod(foot, (corner_x, corner_y, z[1]), 0.35 * thickness, half))
    return join(*made)


def knob(at: Vector, radius: Real) -> Mesh:
    """A round knob that sticks out of a front (towards -y)."""
    x, y, z = at
    stem = rod((x, y, z), (x, y - radius, z), 0.5 * radius)
    return join(stem, ball((x, y - 1.6 * radius, z), (radius, radius, radius), sides=6))


def bar_handle(start: Vector, end: Vector, radius: Real) -> Mesh:
    """A bar in front of a front, on two posts."""
    (x0, y, z0), (x1, _, z1) = start, end
    out = y - 4 * radius
    posts = [rod((x, y, z), (x, out, z), radius) for x, z in ((x0, z0), (x1, z1))]
    return join(rod((x0, out, z0), (x1, out, z1), radius), *posts)


def drawer(x: Span, front: Real, z: Span, handle: Handle) -> Mesh:
    """A drawer's front that stands out of the plane y = ``front``, with its handle."""
    gap = 0.04 * (z[1] - z[0])
    depth = 0.02
    board = block((x[0] + gap, x[1] - gap), (front - depth, front), (z[0] + gap, z[1] - gap))
    middle, height = (x[0] + x[1]) / 2, (z[0] + z[1]) / 2
    quarter, face = (x[1] - x[0]) / 4, front - depth
    if handle == "knob":
        return join(board, knob((middle, face, height), 0.02))
    if handle == "two knobs":
        return join(board, *(knob((middle + s * quarter, face, height), 0.018) for s in (-1, 1)))
    return join(
        board,
        bar_handle(
            (middle - quarter / 2, face, height), (middle + quarter / 2, face, height), 0.008
        ),
    )


def carcass(x: Span, y: Span, z: Span, board: Real) -> Mesh:
    """A cabinet without a front: bottom, top, two sides and a back."""
    return join(
        block(x, y, (z[0], z[0] + board)),
        block(x, y, (z[1] - board, z[1])),
        block((x[0], x[0] + board), y, z),
        block((x[1] - board, x[1]), y, z),
        block(x, (y[1] - board, y[1]), z),
    )


def leaf(base: Vector, tip: Vector, width: Real, droop: Real, steps: int = 6) -> Mesh:
    """A pointed leaf from ``base`` to ``tip``, its middle lifted by ``droop``."""
    s = np.linspace(0, 1, steps)[:, None]
    start, end = np.array(base, dtype=np.float64), np.array(tip, dtype=np.float64)
    spine = start + s * (end - start) + np.array([0, 0, 4 * droop]) * s * (1 - s)
    across = np.array([start[1] - end[1], end[0] - start[0], 0])
    if np.linalg.norm(across) < 1e-9:
        across = np.array([1.0, 0, 0])
    across = across / np.linalg.norm(across)
    half = width / 2 * np.sin(np.pi * (0.08 + 0.9 * s)) * across
    fold = np.array([0, 0, 0.25 * width]) * np.sin(np.pi * s)
    return sheet(
        np.stack([spine - half + fold, spine, spine + half + fold], axis=1), (0, 0, 0.01 * width)
    )


def arc(
    centre: Vector, radius: Real, start_deg: Real, stop_deg: Real, count: int = 10
) -> Float64[np.ndarray, "count 3"]:
    """Points of a level arc, counted from +x towards +y."""
    angle = np.deg2rad(np.linspace(start_deg, stop_deg, count))
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    return radius * circle + np.array(centre, dtype=np.float64)


def tap(base: Vector, height: Real, reach: Vector) -> Mesh:
    """A water tap on ``base``: up, over and down along ``reach``, with a lever on top."""
    x, y, z = base
    radius = 0.07 * height
    over = [
        (x, y, z),
        (x, y, z + 0.8 * height),
        (x + 0.3 * reach[0], y + 0.3 * reach[1], z + height),
    ]
    spout = tube(
        [
            *over,
            (x + reach[0], y + reach[1], z + 0.95 * height),
            (x + reach[0], y + reach[1], z + 0.7 * height),
        ],
        radius,
    )
    lever = rod((x, y, z + 0.7 * height), (x + 0.35 * height, y, z + height), 0.6 * radius)
    return join(spout, lever)


def mirrored(part: Mesh) -> Mesh:
    """Swap left and right."""
    return Mesh(part.vertices * np.array([-1.0, 1, 1]), part.faces[:, ::-1])


def drawers(x: Span, front: Real, z: Span, count: int, generator: np.random.Generator) -> Mesh:
    """A column of drawers, the top ones lower; all with the same kind of handle."""
    handle = HANDLES[generator.integers(3)]
    sizes = np.linspace(1, generator.uniform(0.6, 1), count)
    levels = (z[0] + (z[1] - z[0]) * np.concatenate([[0], np.cumsum(sizes) / sizes.sum()])).tolist()
    return join(*(drawer(x, front, (a, b), handle) for a, b in pairwise(levels)))


def hollow(outside: Outline, wall: Real, floor: Real, sides: int = 24) -> Mesh:
    """A vessel: the outside profile up, the inside one ``wall`` thinner back down to ``floor``."""
    outer = np.asarray(outside, dtype=np.float64)
    inner = outer[::-1] - np.array([wall, 0])
    inner = inner[inner[:, 1] > floor]
    inner[:, 0] = np.maximum(inner[:, 0], 0.3 * wall)
    return lathe(np.vstack([outer, inner, [[0.6 * inner[-1, 0], floor]]]), sides)
