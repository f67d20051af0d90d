"""Made-up things that sound: guitar, piano, radio."""

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.shapes.parts import (
    knob,
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
    smooth,
    tube,
    turn,
)


def guitar(*, generator: np.random.Generator) -> Mesh:
    """A guitar that stands upright, strings to -y: acoustic, or electric with horns."""
    draw = generator.uniform
    electric = generator.random() < 0.5
    body, wide = draw(0.42, 0.52), draw(0.34, 0.42)
    thick = draw(0.035, 0.05) if electric else draw(0.08, 0.12)
    waist = draw(0.6, 0.75)
    right = [
        (0.0, 0),
        (0.7, 0.03),
        (1.0, 0.25),
        (waist, 0.58),
        (0.72, 0.85),
        (0.35, 1.0),
        (0.0, 0.97),
    ]
    left = [(0.35, 1.0), (0.72, 0.85), (waist, 0.58), (1.0, 0.25), (0.7, 0.03)]
    if electric:
        right[4:6] = [(0.85, 1.0), (0.4, 0.85)]
        left[:2] = [(0.3, 0.82), (0.8, draw(1.1, 1.25))]
    knots = np.array([*right, *((-a, b) for a, b in left), (0.0, 0)]) * [wide / 2, body]
    outline = smooth(knots, 44)[:-1]
    neck, front = draw(0.34, 0.42), -thick / 2
    top = body + neck
    parts = [
        slab(outline, (front, thick / 2), "y"),
        block((-0.026, 0.026), (front - 0.015, front + 0.02), (0.75 * body, top), 0.9),
        block((-0.04, 0.04), (front - 0.005, front + 0.015), (top, top + 0.17), 0.75),
        block((-0.09, 0.09), (front - 0.012, front), (0.2 * body, 0.27 * body)),
    ]
    parts += [
        rod((at, front - 0.018, 0.24 * body), (0.7 * at, front - 0.018, top), 0.0012)
        for at in np.linspace(-0.018, 0.018, 6).tolist()
    ]
    pegs = [
        (side, top + 0.03 + 0.045 * k) for side in ((1,) if electric else (-1, 1)) for k in range(3)
    ]
    parts += [
        rod((side * 0.03, front + 0.005, z), (side * 0.07, front + 0.005, z), 0.007, 0.011)
        for side, z in pegs
    ]
    if electric:
        parts += [
            block((-0.045, 0.045), (front - 0.012, front), (z * body, z * body + 0.035))
            for z in (0.4, 0.6)
        ]
        parts += [
            disc((0.3 * wide, front - 0.01, z * body), "y", 0.014, 0.02, 10) for z in (0.12, 0.22)
        ]
    else:
        parts.append(disc((0, front, 0.62 * body), "y", 0.05, 0.008))
        parts.append(
            slab(
                [(0.05, 0.4 * body), (0.12, 0.45 * body), (0.06, 0.62 * body)],
                (front - 0.006, front),
                "y",
            )
        )
    return join(*parts)


def piano(*, generator: np.random.Generator) -> Mesh:
    """A piano: upright, or grand with its lid raised; white and black keys, pedals."""
    draw = generator.uniform
    width, key_height = draw(1.3, 1.5), draw(0.66, 0.74)
    x = (-width / 2, width / 2)
    parts = [
        _piano_keys((x[0] + 0.06, x[1] - 0.06), key_height + 0.06),
        block(x, (-0.18, 0.02), (key_height - 0.05, key_height + 0.05)),
    ]
    parts += [
        block((at - 0.05, at), (-0.18, 0.1), (key_height, key_height + 0.14))
        for at in (x[0] + 0.05, x[1])
    ]
    parts += [rod((at, 0.15, 0.06), (at, -0.08, 0.05), 0.012) for at in (-0.1, 0.0, 0.1)]
    if generator.random() < 0.5:
        height, deep = draw(1.05, 1.35), draw(0.3, 0.5)
        parts += [
            block(x, (0.02, deep), (0, height)),
            block((x[0] - 0.02, x[1] + 0.02), (0, deep + 0.02), (height, height + 0.03)),
            turn(
                block((-0.35, 0.35), (-0.02, 0), (key_height + 0.12, key_height + 0.32)),
                "x",
                -15,
                about=(0, 0, key_height + 0.12),
            ),
            *(
                block((at - 0.05, at + 0.05), (-0.18, 0), (0, key_height - 0.05))
                for at in (x[0] + 0.05, x[1] - 0.05)
            ),
        ]
        return join(*parts)
    length = draw(1.1, 1.9)
    curve = smooth(
        [
            (x[1], 0.0),
            (x[1], 0.35 * length),
            (0.35 * x[1], 0.65 * length),
            (0.1 * x[1], 0.95 * length),
            (0.5 * x[0], length),
            (x[0], 0.9 * length),
        ],
        20,
    )
    outline = np.vstack([curve, [[x[0], 0.0]]])
    case = (key_height - 0.08, key_height + 0.2)
    lid = turn(
        slab(outline, (case[1], case[1] + 0.02)), "y", -draw(20, 40), about=(x[0], 0, case[1])
    )
    prop = rod(
        (x[1] - 0.1, 0.3 * length, case[1]), (0.3 * x[1], 0.3 * length, case[1] + 0.3), 0.012
    )
    lyre = block((-0.13, 0.13), (0.12, 0.16), (0.02, case[0]))
    feet = [(x[0] + 0.12, 0.1), (x[1] - 0.12, 0.1), (0.4 * x[0], 0.85 * length)]
    parts += [rod((a, b, 0), (a, b, case[0]), 0.04, 0.06) for a, b in feet]
    return join(
        *parts,
        slab(outline, case),
        lid,
        prop,
        lyre,
        block((-0.3, 0.3), (0.1, 0.12), (case[1], case[1] + 0.2)),
    )


def _piano_keys(x: Span, height: Real) -> Mesh:
    pitch = (x[1] - x[0]) / 35
    white = [
        block((x[0] + k * pitch, x[0] + (k + 0.9) * pitch), (-0.16, 0.0), (height - 0.02, height))
        for k in range(35)
    ]
    black = [
        block(
            (x[0] + (k + 0.65) * pitch, x[0] + (k + 1.25) * pitch),
            (-0.1, 0.0),
            (height, height + 0.012),
        )
        for k in range(34)
        if k % 7 not in (1, 4)
    ]
    return join(*white, *black)


def radio(*, generator: np.random.Generator) -> Mesh:
    """A radio: speakers, a dial, knobs, a handle, an aerial on one side."""
    draw = generator.uniform
    width, height, depth = draw(0.22, 0.5), draw(0.14, 0.28), draw(0.07, 0.14)
    x, y = (-width / 2, width / 2), (-depth / 2, depth / 2)
    style = int(generator.integers(3))
    if style == 2:  # an arched case, as of old
        crown = [
            (x[1] * np.cos(a), height + 0.4 * height * np.sin(a)) for a in np.linspace(0, np.pi, 14)
        ]
        parts = [slab([*crown, (x[0], 0), (x[1], 0)], y, "y")]
    else:
        parts = [cushion(x, y, (0, height), 8)]
    size, front = draw(0.3, 0.42) * height, y[0]
    speakers = [(x[0] + 1.15 * size)] if style == 0 else [x[0] + 1.1 * size, x[1] - 1.1 * size]
    for at in speakers:
        cone = lathe(
            [(size, 0), (size, 0.02), (0.85 * size, 0.02), (0.3 * size, 0.005), (0.2 * size, 0.015)]
        )
        parts.append(move(turn(cone, "x", 90), (at, front, 0.45 * height)))
    dial = (0.0, 0.9 * x[1]) if style == 0 else (-0.16 * width, 0.16 * width)
    parts.append(block(dial, (front - 0.008, front), (0.62 * height, 0.85 * height)))
    middle = (dial[0] + dial[1]) / 2
    parts += [
        knob((middle + s * 0.1 * width, front, 0.3 * height), draw(0.015, 0.03)) for s in (-1, 1)
    ]
    parts += [
        block(
            (middle + s * 0.03, middle + s * 0.03 + 0.02),
            (front - 0.01, front),
            (0.48 * height, 0.55 * height),
        )
        for s in (-2, 0, 2)
    ]
    top = height * (1.4 if style == 2 else 1)
    if style < 2:
        loop = [
            (0.8 * x[0], 0, height),
            (0.8 * x[0], 0, 1.2 * height),
            (0.8 * x[1], 0, 1.2 * height),
            (0.8 * x[1], 0, height),
        ]
        parts.append(tube(loop, 0.01))
    lean = draw(-0.3, 0.8) * height
    parts.append(
        rod(
            (0.7 * x[1], 0.6 * y[1], 0.8 * top),
            (0.7 * x[1] + lean, 0.6 * y[1], top + draw(0.8, 1.6) * height),
            0.006,
            0.003,
        )
    )
    parts.append(
        legs((0.8 * x[0], 0.8 * x[1]), (0.8 * y[0], 0.8 * y[1]), (-0.01, 0.01), 0.02, "round")
    )
    return join(*parts)
