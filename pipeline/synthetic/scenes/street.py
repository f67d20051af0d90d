"""Streets of random course and frontage: ground, houses, cars, trees and street furniture."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.scenes.rays import (
    ball,
    box,
    frustum,
    leaves,
    merged,
    placed,
    sheet,
    tapered,
)

Metres = Float64[np.ndarray, " stations"]


@dataclass(frozen=True)
class Material:
    """How a surface answers a laser pulse."""

    reflectance: float
    """Share returned head on, 0 to 1."""
    lost: float
    """Share of the pulses that never come back."""


ASPHALT = Material(0.22, 0.03)
PAVING = Material(0.34, 0.02)
GRASS = Material(0.42, 0.03)
PLASTER = Material(0.45, 0.01)
BRICK = Material(0.30, 0.01)
GLASS = Material(0.12, 0.75)
PAINT = Material(0.35, 0.12)
RUBBER = Material(0.08, 0.10)
LEAF = Material(0.40, 0.06)
BARK = Material(0.25, 0.02)
METAL = Material(0.50, 0.03)
SIGN = Material(0.99, 0.0)
MATERIALS = (
    *(ASPHALT, PAVING, GRASS, PLASTER, BRICK, GLASS),
    *(PAINT, RUBBER, LEAF, BARK, METAL, SIGN),
)

Part = tuple[Material, Mesh]


def _set(parts: list[Part], x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> list[Part]:
    return [(material, placed(mesh, x, y, z, yaw)) for material, mesh in parts]


@dataclass(frozen=True)
class Road:
    """A road's centre line and width; left is positive, metres and radians."""

    s: Metres
    x: Metres
    y: Metres
    z: Metres
    heading: Metres
    half_width: float
    kerb: Metres
    """Height of the pavement over the road; 0 where a side road joins."""

    def at(self, s: float, left: float = 0.0) -> tuple[float, float, float, float]:
        """Where the road surface is: x, y, z and the heading there."""
        x, y, z, heading = (
            float(np.interp(s, self.s, values)) for values in (self.x, self.y, self.z, self.heading)
        )
        return x - left * np.sin(heading), y + left * np.cos(heading), z, heading

    def stand(self, parts: list[Part], s: float, left: float, turn: float = 0.0) -> list[Part]:
        """Put parts beside (or on) the road, on the pavement where there is one."""
        x, y, z, heading = self.at(s, left)
        if abs(left) > self.half_width:
            z += float(np.interp(s, self.s, self.kerb))
        return _set(parts, x, y, z, heading + turn)


def sample_road(length: float, *, generator: np.random.Generator) -> tuple[Road, list[float]]:
    """Draw a road's course, and where side roads join it.

    Bends are no tighter than a radius of 45 m, slopes no steeper than 6 %.
    """
    s = np.arange(0.0, length + 1.0)
    phase = generator.uniform(0, 2 * np.pi, 4)
    heading = generator.uniform(0.15, 0.35) * np.sin(2 * np.pi * s / 180 + phase[0])
    heading += generator.uniform(0.0, 0.1) * np.sin(2 * np.pi * s / 70 + phase[1])
    height = 0.7 * np.sin(2 * np.pi * s / 140 + phase[2]) + 0.15 * np.sin(s / 8 + phase[3])
    joins = [float(j) for j in np.arange(generator.uniform(10, 70), length, 75.0)]
    gaps = np.array([np.abs(s - join) for join in joins] or [np.full_like(s, np.inf)])
    kerb = 0.13 * np.clip((gaps.min(axis=0) - 5.0) / 2.0, 0.0, 1.0)
    road = Road(
        s=s,
        x=np.cumsum(np.cos(heading)),
        y=np.cumsum(np.sin(heading)),
        z=height,
        heading=heading,
        half_width=generator.uniform(5.0, 6.0),
        kerb=kerb,
    )
    return road, joins


def sample_street(length: float, *, generator: np.random.Generator) -> tuple[Road, list[Part]]:
    """Draw a road of ``length`` metres and everything along it.

    Each street has its own mixture of town, suburb and park.
    """
    road, joins = sample_road(length, generator=generator)
    parts = _ground(road, generator)
    mixture = generator.dirichlet([1.2, 1.2, 0.6])
    for side in (-1.0, 1.0):
        parts += _frontage(road, joins, side, mixture, generator)
        parts += _kerbside(road, joins, side, generator)
    return road, parts


def _ground(road: Road, generator: np.random.Generator) -> list[Part]:
    """Cambered roadway, kerbs with pavements, and uneven green land to 36 m on either side."""
    half, far = road.half_width, road.half_width + 3.0
    strips = (
        (ASPHALT, np.array([-half, -half / 2, 0.0, half / 2, half])),
        (PAVING, np.array([half, half + 0.02, far])),
        (PAVING, np.array([-far, -half - 0.02, -half])),
        (GRASS, np.array([far, far + 2, far + 5, far + 10, 20, 28, 36])),
        (GRASS, -np.array([far, far + 2, far + 5, far + 10, 20, 28, 36])[::-1]),
    )
    return [(material, _strip(road, left, generator)) for material, left in strips]


def _strip(road: Road, left: Metres, generator: np.random.Generator) -> Mesh:
    s, across = np.meshgrid(np.arange(len(road.s)), left, indexing="ij")
    heading = road.heading[s]
    camber = 0.05 * (1 - (across / road.half_width) ** 2).clip(0.0)
    lifted = np.where(np.abs(across) > road.half_width, road.kerb[s], 0.0)
    rough = 0.03 * generator.standard_normal(s.shape) * (np.abs(across) > road.half_width + 3.5)
    return sheet(
        np.stack(
            [
                road.x[s] - across * np.sin(heading),
                road.y[s] + across * np.cos(heading),
                road.z[s] + camber + lifted + rough,
            ],
            axis=-1,
        )
    )


def _frontage(
    road: Road,
    joins: list[float],
    side: float,
    mixture: Float64[np.ndarray, "3"],
    generator: np.random.Generator,
) -> list[Part]:
    """Plot after plot along one side, leaving the side roads open, and a loose row behind."""
    plots = (_town_house, _garden_house, _park)
    turn = 0.0 if side > 0 else np.pi  # plots have the street along x, the land towards +y
    parts: list[Part] = []
    ends = [*(join - 4.5 for join in joins), float(road.s[-1])]
    s = 0.0
    while ends:
        length = min(generator.uniform(9.0, 16.0), ends[0] - s)
        if length < 6.0:
            s = ends.pop(0) + 9.0
            continue
        plot = plots[generator.choice(3, p=mixture)](length, generator)
        parts += road.stand(plot, s + length / 2, side * (road.half_width + 3.0), turn)
        s += length
    for s in np.arange(5.0, road.s[-1], 11.0):
        behind = (_garden_house, _tree_pair, _tree_pair)[generator.integers(3)](11.0, generator)
        parts += road.stand(behind, float(s), side * generator.uniform(20.0, 26.0), turn)
    return parts


def _tree_pair(length: float, generator: np.random.Generator) -> list[Part]:
    return [
        part
        for x in (-length / 4, length / 4)
        for part in _set(_tree(generator), x, generator.uniform(0.0, 5.0))
    ]


def _town_house(length: float, generator: np.random.Generator) -> list[Part]:
    """A block of flats: its windows are recesses between piers and floor bands."""
    floors, setback = int(generator.integers(2, 6)), generator.uniform(0.0, 1.2)
    storey = generator.uniform(2.9, 3.4)
    height, depth = floors * storey + 0.6, generator.uniform(8.0, 12.0)
    wall = PLASTER if generator.random() < 0.6 else BRICK
    core = placed(box(length, depth, height), 0.0, depth / 2 + 0.3)
    axes = int(length // generator.uniform(2.2, 3.0))
    spacing, pane = length / axes, generator.uniform(1.0, 1.4)
    masonry, panes = [core], []
    for axis in range(axes + 1):
        pier = box(spacing - pane, 0.3, height)
        masonry.append(placed(pier, axis * spacing - length / 2, 0.15))
    for floor in range(floors + 1):
        band = box(length, 0.28, 1.1 if floor else 0.7)
        masonry.append(placed(band, 0.0, 0.16, max(floor * storey - 0.2, 0.0)))
    for floor in range(floors):
        z = max(floor * storey + 0.9, 0.7)
        for axis in range(axes):
            x = (axis + 0.5) * spacing - length / 2
            panes.append(placed(box(pane, 0.04, storey - 1.1), x, 0.27, z))
            if floor and generator.random() < 0.15:
                masonry.append(placed(box(pane + 0.8, 1.0, 1.1), x, -0.5, z - 1.1))
    door = placed(box(1.3, 0.1, 2.3), generator.uniform(-0.3, 0.3) * length, -0.02)
    masonry.append(placed(box(length + 0.3, depth + 0.6, 0.3), 0.0, depth / 2, height))
    return _set([(wall, merged(masonry)), (GLASS, merged(panes)), (BARK, door)], 0.0, setback)


def _garden_house(length: float, generator: np.random.Generator) -> list[Part]:
    """A gabled house behind a fence or hedge, with a tree and bushes in its garden."""
    width, depth = length * generator.uniform(0.55, 0.75), generator.uniform(7.0, 9.0)
    eaves, setback = generator.uniform(3.0, 5.5), generator.uniform(3.0, 6.0)
    ridge = eaves + generator.uniform(2.0, 3.5)
    roof = tapered((width + 0.8, depth + 1.0), (width + 0.8, 0.1), ridge - eaves)
    walls = [placed(box(width, depth, eaves), 0.0, depth / 2)]
    walls.append(placed(box(0.7, 0.7, ridge - 1), width / 4, depth * 0.6, 1.5))
    walls.append(placed(box(2.0, 1.4, 2.5), generator.uniform(-0.2, 0.2) * width, -0.6))
    panes = [
        placed(box(1.2, 0.08, 1.2), x * width, -0.03, z)
        for x in (-0.35, 0.35)
        for z in np.arange(1.0, eaves - 1.2, 2.7)
    ]
    parts: list[Part] = [
        (PLASTER, merged(walls)),
        (BRICK, placed(roof, 0.0, depth / 2, eaves)),
        (GLASS, merged(panes)),
    ]
    parts = _set(parts, generator.uniform(-0.1, 0.1) * length, setback)
    border = _fence if generator.random() < 0.6 else _hedge
    parts += border(length * 0.75, generator)
    x, y = generator.uniform(-0.4, 0.4) * length, generator.uniform(1.2, setback - 1)
    parts += _set(_bush(generator), x, y)
    return parts + _set(_tree(generator), generator.uniform(-0.45, 0.45) * length, setback - 1.2)


def _park(length: float, generator: np.random.Generator) -> list[Part]:
    """Trees and bushes on open ground, sometimes behind a fence."""
    parts = _fence(length, generator) if generator.random() < 0.4 else []
    for maker, count in ((_tree, 5), (_bush, 6)):
        for _ in range(count):
            x, y = generator.uniform(-0.5, 0.5) * length, generator.uniform(1.0, 16.0)
            parts += _set(maker(generator), x, y)
    return parts


def _fence(length: float, generator: np.random.Generator) -> list[Part]:
    height = generator.uniform(0.9, 1.4)
    pales = [
        placed(box(0.09, 0.03, height), x, 0.1) for x in np.arange(-length / 2, length / 2, 0.22)
    ]
    rails = [placed(box(length, 0.05, 0.08), 0.0, 0.14, height * z) for z in (0.25, 0.8)]
    return [(BARK, merged(pales + rails))]


def _hedge(length: float, generator: np.random.Generator) -> list[Part]:
    height = generator.uniform(1.0, 1.8)
    crowns = [
        placed(leaves((0.9, 0.5, height / 2), 160, 0.16, generator=generator), x, 0.6)
        for x in np.arange(-length / 2, length / 2, 1.1)
    ]
    return [(LEAF, merged(crowns)), (LEAF, placed(box(length, 0.4, height * 0.8), 0.0, 0.6))]


def _tree(generator: np.random.Generator) -> list[Part]:
    stem, radius = generator.uniform(2.0, 3.2), generator.uniform(1.5, 2.8)
    height = generator.uniform(1.8, 3.2)
    crown = leaves((radius, radius, height), int(180 * radius), 0.3, generator=generator)
    thick = generator.uniform(0.12, 0.25)
    trunk = frustum(thick, thick * 0.5, stem + height, sides=8)
    return [(BARK, trunk), (LEAF, placed(crown, 0.0, 0.0, stem))]


def _bush(generator: np.random.Generator) -> list[Part]:
    radii = tuple(generator.uniform(0.5, 1.1, 3))
    return [(LEAF, leaves((radii[0], radii[1], radii[2]), 220, 0.16, generator=generator))]


def _kerbside(
    road: Road, joins: list[float], side: float, generator: np.random.Generator
) -> list[Part]:
    """Parked cars, street trees, lamp posts, signs, bins and people along one side."""
    parts: list[Part] = []
    occupied, planted = generator.uniform(0.3, 0.85), generator.uniform(0.1, 0.8)
    for s in np.arange(3.0, road.s[-1] - 3.0, 6.2):
        if any(abs(s - join) < 8.0 for join in joins):
            continue
        if generator.random() < occupied:
            left = side * (road.half_width - generator.uniform(1.0, 1.25))
            turn = generator.uniform(-0.04, 0.04) + (0.0 if side < 0 else np.pi)
            parts += road.stand(_car(generator), s + generator.uniform(-0.6, 0.6), left, turn)
        if generator.random() < planted * 0.6:
            parts += road.stand(_tree(generator), s + 3.0, side * (road.half_width + 0.8))
        thing = (_lamp_post, _sign, _bin, _person)[generator.integers(4)]
        left = side * (road.half_width + generator.uniform(0.5, 2.3))
        if generator.random() < 0.55:
            parts += road.stand(thing(generator), s + 1.5, left, side * np.pi / 2)
    return parts


def _car(generator: np.random.Generator) -> list[Part]:
    """A parked car or van facing +x: body, bonnet, cabin with windows, wheels, mirrors."""
    van = generator.random() < 0.2
    length, width = generator.uniform(3.9, 4.8) + 0.5 * van, generator.uniform(1.68, 1.85)
    belt, roof = generator.uniform(0.85, 0.95), 2.0 if van else generator.uniform(1.42, 1.6)
    cabin, shift = (0.88, -0.05) if van else (generator.uniform(0.55, 0.68), -0.07)
    lower = tapered((length, width * 0.94), (length * 0.98, width), belt * 0.55)
    upper = tapered((length * 0.98, width), (length * 0.93, width * 0.94), belt * 0.32)
    glass = tapered(
        (length * cabin, width * 0.9), (length * cabin * 0.72, width * 0.74), roof - belt - 0.04
    )
    top = box(length * cabin * 0.72, width * 0.74, 0.05)
    pillars = [
        placed(box(0.12, width * 0.86, roof - belt - 0.1), length * (shift + x), 0.0, belt - 0.05)
        for x in (-0.15, 0.08)
    ]
    mirrors = [placed(box(0.12, 0.2, 0.14), length * 0.17, y * width * 0.55, belt) for y in (-1, 1)]
    body = [
        placed(lower, 0.0, 0.0, 0.2),
        placed(upper, 0.0, 0.0, 0.2 + belt * 0.55),
        placed(top, length * shift, 0.0, roof - 0.05),
        *pillars,
        *mirrors,
    ]
    wheels = [
        placed(_wheel(), x * length, y * width * 0.46) for x in (-0.31, 0.31) for y in (-1, 1)
    ]
    return [
        (PAINT, merged(body)),
        (GLASS, placed(glass, length * shift, 0.0, belt)),
        (RUBBER, merged(wheels)),
        (SIGN, placed(box(0.02, 0.5, 0.11), -length / 2 - 0.01, 0.0, 0.45)),
    ]


def _wheel() -> Mesh:
    disc = frustum(0.32, 0.32, 0.2).vertices[:, [0, 2, 1]] + [0.0, -0.1, 0.32]
    return Mesh(disc, frustum(0.32, 0.32, 0.2).faces)


def _lamp_post(generator: np.random.Generator) -> list[Part]:
    height = generator.uniform(5.0, 8.0)
    arm = placed(box(1.4, 0.12, 0.12), -0.6, 0.0, height)
    return [(METAL, merged([frustum(0.1, 0.06, height, sides=8), arm]))]


def _sign(generator: np.random.Generator) -> list[Part]:
    height = generator.uniform(1.9, 2.4)
    # The plate faces along the road; the part's x axis points across it.
    plate = box(0.6, 0.03, 0.6) if generator.random() < 0.6 else box(0.9, 0.03, 0.35)
    post = frustum(0.035, 0.035, height + 0.6, sides=6)
    return [(METAL, post), (SIGN, placed(plate, 0.0, 0.05, height))]


def _bin(generator: np.random.Generator) -> list[Part]:
    return [(RUBBER, box(0.55, 0.6, generator.uniform(0.9, 1.2)))]


def _person(generator: np.random.Generator) -> list[Part]:
    height = generator.uniform(1.5, 1.9)
    stride = generator.uniform(0.1, 0.25)
    limbs = [placed(frustum(0.07, 0.1, height * 0.48, 8), 0.0, y * stride) for y in (-1, 1)]
    torso = placed(ball(0.24, 0.16, height * 0.2), 0.0, 0.0, height * 0.45)
    head = placed(ball(0.11, 0.11, 0.13), 0.0, 0.0, height - 0.26)
    return [(LEAF, merged([*limbs, torso, head]))]
