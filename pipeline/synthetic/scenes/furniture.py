"""Pieces of furniture of random make, in metres; each stands on z = 0, its back along y = 0.

A piece reaches from y = 0 into the room (positive y) and is centred in x.
"""

from collections.abc import Callable

import numpy as np

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.scenes.rays import ball, box, frustum, leaves, merged, placed, tapered

Maker = Callable[[np.random.Generator], Mesh]


def clutter(width: float, depth: float, count: int, generator: np.random.Generator) -> list[Mesh]:
    """Small things strewn over a surface of the given size whose back is at y = 0, z = 0."""
    things = (_mug, _bottle, _books_lying, _carton, _bowl, _laptop)
    return [
        placed(
            things[generator.integers(len(things))](generator),
            generator.uniform(-0.42, 0.42) * width,
            generator.uniform(0.2, 0.8) * depth,
            0.0,
            generator.uniform(-np.pi, np.pi),
        )
        for _ in range(count)
    ]


def _mug(generator: np.random.Generator) -> Mesh:
    radius = generator.uniform(0.035, 0.06)
    return merged(
        [frustum(radius, radius * 1.1, 0.1), placed(box(0.04, 0.015, 0.07), radius + 0.02, 0.0)]
    )


def _bottle(generator: np.random.Generator) -> Mesh:
    radius, height = generator.uniform(0.035, 0.05), generator.uniform(0.15, 0.22)
    return merged(
        [
            frustum(radius, radius, height),
            placed(frustum(radius, 0.015, 0.05), 0.0, 0.0, height),
            placed(frustum(0.015, 0.015, 0.06), 0.0, 0.0, height + 0.05),
        ]
    )


def _books_lying(generator: np.random.Generator) -> Mesh:
    heights = generator.uniform(0.02, 0.05, generator.integers(1, 5))
    floors = np.cumsum(heights) - heights
    return merged(
        [
            placed(
                box(generator.uniform(0.14, 0.2), generator.uniform(0.2, 0.28), h),
                0.0,
                0.0,
                z,
                generator.uniform(-0.3, 0.3),
            )
            for h, z in zip(heights, floors, strict=True)
        ]
    )


def _carton(generator: np.random.Generator) -> Mesh:
    return box(*generator.uniform(0.1, 0.3, 3))


def _bowl(generator: np.random.Generator) -> Mesh:
    radius = generator.uniform(0.09, 0.15)
    fruit = [
        placed(ball(0.04, 0.04, 0.04), x * radius, y * radius, 0.05)
        for x, y in generator.uniform(-0.5, 0.5, (4, 2))
    ]
    return merged([frustum(radius * 0.5, radius, 0.07), *fruit])


def _laptop(generator: np.random.Generator) -> Mesh:
    lean = generator.uniform(0.02, 0.1)
    screen = tapered((0.34, 0.012), (0.34, 0.012), 0.22, (0.0, -lean))
    return merged([box(0.34, 0.24, 0.02), placed(screen, 0.0, -0.12, 0.02)])


def _legs(width: float, depth: float, height: float, thickness: float) -> list[Mesh]:
    x, y = (width - thickness) / 2 - 0.02, (depth - thickness) / 2 - 0.02
    return [
        placed(box(thickness, thickness, height), sx * x, depth / 2 + sy * y)
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]


def _chair(generator: np.random.Generator) -> Mesh:
    width, seat = generator.uniform(0.4, 0.5), generator.uniform(0.42, 0.48)
    back = generator.uniform(0.35, 0.5)
    lean = tapered((width, 0.04), (width, 0.03), back, (0.0, -0.06))
    return merged(
        [
            *_legs(width, 0.45, seat, 0.045),
            placed(box(width, 0.45, 0.05), 0.0, 0.225, seat),
            placed(lean, 0.0, 0.06, seat + 0.1),
        ]
    )


def _board(width: float, depth: float, height: float) -> list[Mesh]:
    """A table top and its legs."""
    top = placed(box(width, depth, 0.04), 0.0, depth / 2, height - 0.04)
    return [*_legs(width, depth, height - 0.04, 0.06), top]


def dining_table(generator: np.random.Generator) -> Mesh:
    """A laid table with two to five chairs, some pulled out."""
    width, depth = generator.uniform(1.2, 1.8), generator.uniform(0.75, 0.95)
    parts = [*_board(width, depth, 0.75)]
    parts += [placed(m, 0.0, 0.0, 0.75) for m in clutter(width, depth, 7, generator)]
    seats = [(x * width, side) for side in (0.0, np.pi) for x in (-0.25, 0.25)]
    for index in generator.permutation(4)[: generator.integers(2, 5)]:
        x, yaw = seats[index]
        out = generator.uniform(0.05, 0.35)
        y = -out if yaw == 0.0 else depth + out
        parts.append(placed(_chair(generator), x, y, 0.0, yaw + generator.uniform(-0.4, 0.4)))
    return placed(merged(parts), 0.0, 0.45)


def coffee_table(generator: np.random.Generator) -> Mesh:
    """A low table with things on it."""
    width, depth = generator.uniform(0.8, 1.2), generator.uniform(0.5, 0.7)
    strewn = [placed(m, 0.0, 0.0, 0.42) for m in clutter(width, depth, 5, generator)]
    return merged([*_board(width, depth, 0.42), *strewn])


def desk(generator: np.random.Generator) -> Mesh:
    """A desk with drawers, monitor, keyboard, clutter and a swivel chair."""
    width, depth = generator.uniform(1.2, 1.7), generator.uniform(0.65, 0.8)
    side = generator.choice([-1.0, 1.0])
    parts = [*_board(width, depth, 0.74), placed(_drawers(0.4, 0.55, 0.62, 3), 0.35 * side, 0.05)]
    x = -side * generator.uniform(0.0, 0.3)
    parts.append(placed(_monitor(generator), x, 0.22, 0.74, generator.uniform(-0.3, 0.3)))
    parts.append(placed(box(0.44, 0.15, 0.025), x, 0.48, 0.74, generator.uniform(-0.1, 0.1)))
    parts += [placed(m, 0.0, 0.0, 0.74) for m in clutter(width, depth, 5, generator)]
    parts.append(
        placed(_swivel_chair(generator), x, depth + 0.35, 0.0, generator.uniform(2.0, 4.0))
    )
    return merged(parts)


def _monitor(generator: np.random.Generator) -> Mesh:
    width = generator.uniform(0.5, 0.7)
    return merged(
        [
            frustum(0.12, 0.12, 0.02),
            placed(box(0.05, 0.04, 0.2), 0.0, -0.03),
            placed(box(width, 0.05, width * 0.58), 0.0, 0.0, 0.12),
        ]
    )


def _swivel_chair(generator: np.random.Generator) -> Mesh:
    feet = [placed(box(0.6, 0.05, 0.06), 0.0, 0.0, 0.02, a) for a in (0.0, 1.05, 2.1)]
    back = tapered((0.44, 0.08), (0.38, 0.05), generator.uniform(0.45, 0.6), (0.0, -0.1))
    return merged(
        [
            *feet,
            frustum(0.03, 0.03, 0.42),
            placed(box(0.48, 0.46, 0.08), 0.0, 0.0, 0.42),
            placed(back, 0.0, -0.2, 0.55),
            placed(box(0.05, 0.26, 0.22), -0.26, 0.0, 0.45),
            placed(box(0.05, 0.26, 0.22), 0.26, 0.0, 0.45),
        ]
    )


def _drawers(width: float, depth: float, height: float, count: int) -> Mesh:
    """A cabinet body with ``count`` drawer fronts and their handles."""
    each = height / count
    parts = [placed(box(width, depth, height), 0.0, depth / 2)]
    for index in range(count):
        z = index * each
        front = box(width - 0.04, 0.025, each - 0.03)
        parts.append(placed(front, 0.0, depth + 0.0125, z + 0.015))
        parts.append(placed(box(0.14, 0.03, 0.02), 0.0, depth + 0.04, z + each * 0.6))
    return merged(parts)


def _doors(width: float, depth: float, height: float, count: int) -> Mesh:
    """A cabinet body with ``count`` door leaves side by side and their handles."""
    each = width / count
    parts = [placed(box(width, depth, height), 0.0, depth / 2)]
    for index in range(count):
        x = (index + 0.5) * each - width / 2
        leaf = box(each - 0.02, 0.025, height - 0.04)
        parts.append(placed(leaf, x, depth + 0.0125, 0.02))
        handle = box(0.02, 0.035, 0.18)
        parts.append(placed(handle, x + each * 0.38, depth + 0.04, height * 0.5))
    return merged(parts)


def sofa(generator: np.random.Generator) -> Mesh:
    """A sofa for two or three with loose cushions."""
    width, depth = generator.uniform(1.5, 2.1), generator.uniform(0.8, 0.95)
    seats = 2 if width < 1.8 else 3
    each = (width - 0.36) / seats
    parts = [
        placed(box(width, depth, 0.3), 0.0, depth / 2, 0.06),
        placed(tapered((width, 0.24), (width, 0.16), 0.55, (0.0, -0.04)), 0.0, 0.12, 0.3),
        placed(box(0.18, depth, 0.6), -(width - 0.18) / 2, depth / 2),
        placed(box(0.18, depth, 0.6), (width - 0.18) / 2, depth / 2),
    ]
    for seat in range(seats):
        x = (seat + 0.5) * each - (width - 0.36) / 2
        parts.append(placed(box(each - 0.03, depth - 0.25, 0.14), x, depth / 2 + 0.13, 0.34))
    for _ in range(generator.integers(1, 4)):
        cushion = ball(0.22, 0.09, 0.2)
        x = generator.uniform(-0.3, 0.3) * width
        parts.append(placed(cushion, x, 0.36, 0.47, generator.uniform(-0.5, 0.5)))
    return merged(parts)


def armchair(generator: np.random.Generator) -> Mesh:
    """A broad upholstered chair."""
    width = generator.uniform(0.75, 0.9)
    return merged(
        [
            placed(box(width, 0.8, 0.4), 0.0, 0.4),
            placed(tapered((width, 0.22), (width * 0.9, 0.14), 0.55, (0.0, -0.04)), 0.0, 0.12, 0.4),
            placed(box(0.16, 0.75, 0.6), -width / 2, 0.4),
            placed(box(0.16, 0.75, 0.6), width / 2, 0.4),
            placed(ball(0.2, 0.08, 0.18), 0.0, 0.34, 0.42, generator.uniform(-0.4, 0.4)),
        ]
    )


def bed(generator: np.random.Generator) -> Mesh:
    """A bed with headboard, pillows and a blanket thrown back."""
    width = generator.uniform(1.2, 1.8)
    return merged(
        [
            placed(box(width, 0.08, generator.uniform(0.8, 1.1)), 0.0, 0.04),
            placed(box(width, 2.0, 0.28), 0.0, 1.08, 0.05),
            placed(box(width - 0.06, 1.94, 0.2), 0.0, 1.06, 0.33),
            *[
                placed(ball(0.3, 0.18, 0.09), x * width, 0.35, 0.5, generator.uniform(-0.2, 0.2))
                for x in (-0.25, 0.25)
            ],
            placed(box(width + 0.06, generator.uniform(0.9, 1.2), 0.06), 0.0, 1.4, 0.53),
            placed(ball(width * 0.45, 0.16, 0.07), 0.0, 0.86, 0.53),
        ]
    )


def bookshelf(generator: np.random.Generator) -> Mesh:
    """A shelf whose boards carry rows of books of uneven height, with gaps."""
    width, depth = generator.uniform(0.7, 1.3), generator.uniform(0.26, 0.36)
    levels = int(generator.integers(3, 7))
    each = generator.uniform(0.3, 0.36)
    height = levels * each
    parts = [
        placed(box(0.03, depth, height), side * (width - 0.03) / 2, depth / 2) for side in (-1, 1)
    ]
    parts.append(placed(box(width, 0.02, height), 0.0, 0.01))
    for level in range(levels + 1):
        parts.append(placed(box(width, depth, 0.03), 0.0, depth / 2, level * each))
    for level in range(levels):
        parts += [placed(m, 0.0, 0.0, level * each + 0.03) for m in _book_row(width, generator)]
    return merged(parts)


def _book_row(width: float, generator: np.random.Generator) -> list[Mesh]:
    books: list[Mesh] = []
    x = 0.05 + generator.uniform(0.0, 0.3)
    while x < width - 0.12:
        thickness = generator.uniform(0.02, 0.07)
        book = box(thickness, generator.uniform(0.14, 0.22), generator.uniform(0.16, 0.26))
        books.append(placed(book, x + thickness / 2 - width / 2, 0.14))
        x += thickness + (generator.uniform(0.1, 0.35) if generator.random() < 0.12 else 0.003)
    return books


def wardrobe(generator: np.random.Generator) -> Mesh:
    """A tall cabinet with two or three doors and a suitcase on top."""
    width, height = generator.uniform(0.9, 1.6), generator.uniform(1.85, 2.1)
    body = _doors(width, 0.56, height, 2 if width < 1.2 else 3)
    return merged([body, placed(box(0.6, 0.4, 0.2), 0.0, 0.25, height, 0.2)])


def kitchen_counter(generator: np.random.Generator) -> Mesh:
    """Base cabinets with a worktop, tap, stove, pots and wall cabinets above."""
    width = generator.uniform(1.8, 2.6)
    parts = [
        _doors(width, 0.58, 0.86, 4),
        placed(box(width + 0.02, 0.64, 0.04), 0.0, 0.32, 0.86),
        placed(_doors(width * generator.uniform(0.5, 1.0), 0.34, 0.65, 3), 0.0, 0.0, 1.45),
        placed(box(0.5, 0.38, 0.3), -0.3 * width, 0.22, 0.9),
        placed(frustum(0.02, 0.02, 0.25), 0.1 * width, 0.08, 0.9),
        placed(box(0.03, 0.2, 0.03), 0.1 * width, 0.16, 1.14),
    ]
    for x in (0.25, 0.38):
        radius = generator.uniform(0.09, 0.13)
        pot = frustum(radius, radius, generator.uniform(0.1, 0.2))
        parts.append(placed(pot, x * width, generator.uniform(0.2, 0.45), 0.9))
    return merged(parts + [placed(m, 0.0, 0.0, 0.9) for m in clutter(width, 0.6, 5, generator)])


def fridge(generator: np.random.Generator) -> Mesh:
    """A fridge with two doors above each other."""
    height = generator.uniform(1.5, 1.9)
    split = height * generator.uniform(0.3, 0.65)
    return merged(
        [
            _doors(0.6, 0.6, split - 0.02, 1),
            placed(_doors(0.6, 0.6, height - split, 1), 0.0, 0.0, split),
        ]
    )


def sideboard(generator: np.random.Generator) -> Mesh:
    """A chest of drawers with a television or with clutter on top."""
    width, height = generator.uniform(0.9, 1.5), generator.uniform(0.5, 0.85)
    parts = [_drawers(width, 0.42, height, int(generator.integers(2, 4)))]
    if generator.random() < 0.6:
        parts.append(placed(box(0.4, 0.2, 0.03), 0.0, 0.2, height))
        parts.append(placed(box(width * 0.85, 0.06, width * 0.5), 0.0, 0.2, height + 0.06))
    else:
        parts += [placed(m, 0.0, 0.0, height) for m in clutter(width, 0.42, 5, generator)]
    return merged(parts)


def nightstand(generator: np.random.Generator) -> Mesh:
    """A small drawer cabinet with a table lamp."""
    x = generator.uniform(-0.05, 0.05)
    return merged(
        [
            _drawers(0.45, 0.4, 0.5, 2),
            placed(frustum(0.08, 0.03, 0.25), x, 0.18, 0.5),
            placed(frustum(0.16, 0.1, 0.18), x, 0.18, 0.72),
        ]
    )


def floor_lamp(generator: np.random.Generator) -> Mesh:
    """A standing lamp with a wide shade."""
    height = generator.uniform(1.3, 1.6)
    lamp = [
        frustum(0.15, 0.15, 0.03),
        frustum(0.02, 0.02, height),
        placed(frustum(0.22, 0.14, 0.28), 0.0, 0.0, height),
    ]
    return placed(merged(lamp), 0.0, 0.25)


def plant(generator: np.random.Generator) -> Mesh:
    """A potted plant."""
    radii = (generator.uniform(0.2, 0.35), generator.uniform(0.2, 0.35), 0.45)
    crown = leaves(radii, 120, 0.11, generator=generator)
    pot = [frustum(0.12, 0.18, 0.3), frustum(0.02, 0.02, 0.6), placed(crown, 0.0, 0.0, 0.35)]
    return placed(merged(pot), 0.0, 0.3)


def cartons(generator: np.random.Generator) -> Mesh:
    """Moving boxes, piled up to three high."""
    parts, z = [], 0.0
    for _ in range(generator.integers(1, 4)):
        width, depth, height = generator.uniform(0.25, 0.45, 3)
        parts.append(placed(box(width, depth, height), 0.0, 0.25, z, generator.uniform(-0.4, 0.4)))
        z += height
    return merged(parts)


def waste_bin(generator: np.random.Generator) -> Mesh:
    """A round bin."""
    radius = generator.uniform(0.13, 0.18)
    return placed(frustum(radius * 0.8, radius, generator.uniform(0.3, 0.6)), 0.0, 0.2)
