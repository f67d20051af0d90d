"""Made-up tables: desk and table."""

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    HANDLES,
    LEG_STYLES,
    carcass,
    drawer,
    drawers,
    legs,
    mirrored,
)
from pipeline.synthetic.shapes.solids import (
    Real,
    Span,
    block,
    cushion,
    join,
    lathe,
    move,
    rod,
)


def desk(*, generator: np.random.Generator) -> Mesh:
    """A desk: a pedestal of drawers on one side, legs or a panel on the other."""
    draw = generator.uniform
    width, depth, height = draw(1.0, 1.8), draw(0.5, 0.8), draw(0.7, 0.78)
    x, y, top = (-width / 2, width / 2), (-depth / 2, depth / 2), draw(0.025, 0.05)
    under, wide = height - top, draw(0.25, 0.4) * width
    foot = draw(0.0, 0.12)
    parts = [
        block((x[0] - 0.02, x[1] + 0.02), (y[0] - 0.02, y[1]), (under, height)),
        block((x[0], x[0] + wide), (y[0] + 0.02, y[1]), (foot, under)),
        drawers(
            (x[0], x[0] + wide),
            y[0] + 0.02,
            (foot, under),
            int(generator.integers(2, 5)),
            generator,
        ),
        legs((x[0], x[0] + wide), y, (0, foot + 0.01), 0.05, "square"),
    ]
    if generator.random() < 0.5:
        parts.append(block((x[1] - 0.04, x[1]), y, (0, under)))
    else:
        parts += [
            block((x[1] - 0.06, x[1]), side, (0, under))
            for side in ((y[0], y[0] + 0.06), (y[1] - 0.06, y[1]))
        ]
    if generator.random() < 0.7:
        parts.append(
            block((x[0] + wide, x[1]), (y[1] - 0.05, y[1] - 0.03), (draw(0.2, 0.45), under))
        )
    extra = int(generator.integers(3))
    if extra == 1:  # a hutch on top
        parts.append(
            move(carcass(x, (0, 0.25), (0, draw(0.25, 0.5)), 0.02), (0, y[1] - 0.25, height))
        )
    if extra == 2:  # a return: the short arm of an L
        far = y[0] - draw(0.4, 0.8)
        parts += [block((x[1] - 0.5, x[1]), (far, y[0]), (under, height))]
        parts += [block((x[1] - 0.5, x[1]), (far, far + 0.03), (0, under))]
    turned = join(*parts)
    return turned if generator.random() < 0.5 else mirrored(turned)


def table(*, generator: np.random.Generator) -> Mesh:
    """A table with a drawer pulled out on one side, its top oblong, oval or round."""
    draw = generator.uniform
    width, depth, height = draw(0.8, 2.2), draw(0.6, 1.1), draw(0.4, 0.78)
    squareness = (2, 3, 12)[generator.integers(3)]
    x, y, top = (-width / 2, width / 2), (-depth / 2, depth / 2), draw(0.02, 0.06)
    inset = 0.15 if squareness < 12 else 0.03
    inner_x = (x[0] + inset * width, x[1] - inset * width)
    inner_y = (y[0] + inset * depth, y[1] - inset * depth)
    under = height - top
    out = draw(0.03, 0.2) * depth
    front = inner_y[0] - out
    wide = draw(0.1, 0.2) * width
    side = draw(-0.5, 0.5) * (inner_x[1] - inner_x[0] - 2 * wide)
    box = (side - wide, side + wide)
    parts = [
        cushion(x, y, (under, height), squareness, sides=32),
        carcass(box, (front, inner_y[1] - 0.1), (under - 0.12, under - 0.01), 0.012),
        drawer(box, front, (under - 0.13, under), HANDLES[generator.integers(3)]),
    ]
    base = int(generator.integers(5))
    if base < 3:
        parts.append(legs(inner_x, inner_y, (0, under), draw(0.04, 0.1), LEG_STYLES[base]))
        parts.append(block(inner_x, (inner_y[1] - 0.03, inner_y[1]), (under - 0.1, under)))
    elif base == 3:
        parts += [_trestle(at, inner_y, under) for at in inner_x]
        parts.append(rod((inner_x[0], 0, 0.4 * under), (inner_x[1], 0, 0.4 * under), 0.025))
    else:
        foot = 0.35 * depth
        parts.append(
            lathe([(foot, 0), (foot, 0.03), (0.06, 0.08), (0.05, 0.5 * under), (0.1, under)])
        )
    if generator.random() < 0.4:  # a leaf that hangs down at one end
        parts.append(
            block((x[1], x[1] + 0.03), (0.7 * y[0], 0.7 * y[1]), (height - draw(0.15, 0.3), height))
        )
    return join(*parts)


def _trestle(at: Real, y: Span, top: Real) -> Mesh:
    ends = [((at, y[0], 0), (at, 0.3 * y[1], top)), ((at, y[1], 0), (at, 0.3 * y[0], top))]
    return join(*(rod(low, high, 0.035) for low, high in ends))
