"""Streets of random course and frontage: ground, houses, cars, trees and street furniture."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Float64

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.makers import make
from pipeline.synthetic.shapes.parts import spaced
from pipeline.synthetic.shapes.solids import (
    Real,
    Vector,
    boxes,
    join,
    lathe,
    place,
    rod,
    sheet,
)
from pipeline.synthetic.shapes.vehicles import car_parts

Metres = Float64[np.ndarray, " stations"]


class Material(Enum):
    """How a surface answers a pulse: the share returned head on, and of pulses that get lost."""

    ASPHALT = (0.22, 0.03)
    PAVING = (0.34, 0.02)
    GRASS = (0.42, 0.03)
    PLASTER = (0.45, 0.01)
    BRICK = (0.30, 0.01)
    GLASS = (0.12, 0.75)
    PAINT = (0.35, 0.12)
    RUBBER = (0.08, 0.10)
    LEAF = (0.40, 0.06)
    BARK = (0.25, 0.02)
    METAL = (0.50, 0.03)
    SIGN = (0.99, 0.0)


Part = tuple[Material, Mesh]


def _set(parts: list[Part], at: Vector, yaw_deg: Real = 0) -> list[Part]:
    return [(material, place(mesh, at, yaw_deg)) for material, mesh in parts]


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

    def stand(self, parts: list[Part], s: float, left: float, turn_deg: Real = 0) -> list[Part]:
        """Put parts beside (or on) the road, on the pavement where there is one."""
        x, y, z, heading = self.at(s, left)
        if abs(left) > self.half_width:
            z += float(np.interp(s, self.s, self.kerb))
        return _set(parts, (x, y, z), np.degrees(heading) + turn_deg)


def sample_road(length: float, *, generator: np.random.Generator) -> tuple[Road, list[float]]:
    """Draw a road's course, and where side roads join it.

    Bends are no tighter than a radius of 45 m, slopes no steeper than 6 %.
    """
    draw, s = Draw(generator), np.arange(0.0, length + 1.0)
    phase = generator.uniform(0, 2 * np.pi, 4)
    heading = draw(0.15, 0.35) * np.sin(2 * np.pi * s / 180 + phase[0])
    heading += draw(0.0, 0.1) * np.sin(2 * np.pi * s / 70 + phase[1])
    joins = np.arange(draw(10, 70), length, 75.0)
    gaps = np.abs(s[:, None] - joins).min(axis=1, initial=np.inf)
    road = Road(
        s=s,
        x=np.cumsum(np.cos(heading)),
        y=np.cumsum(np.sin(heading)),
        z=0.7 * np.sin(2 * np.pi * s / 140 + phase[2]) + 0.15 * np.sin(s / 8 + phase[3]),
        heading=heading,
        half_width=draw(5.0, 6.0),
        kerb=0.13 * np.clip((gaps - 5.0) / 2.0, 0.0, 1.0),
    )
    return road, joins.tolist()


def sample_street(length: float, *, generator: np.random.Generator) -> tuple[Road, list[Part]]:
    """Draw a road of ``length`` metres and everything along it.

    Each street has its own mixture of town, suburb and park.
    """
    road, joins = sample_road(length, generator=generator)
    draw, parts = Draw(generator), _ground(road, generator)
    mixture = generator.dirichlet([1.2, 1.2, 0.6])
    for side in (-1, 1):
        parts += _frontage(road, joins, side, mixture, draw)
        parts += _kerbside(road, joins, side, draw)
    return road, parts


def _ground(road: Road, generator: np.random.Generator) -> list[Part]:
    """Cambered roadway, kerbs with pavements, and uneven green land to 36 m on either side."""
    half, far = road.half_width, road.half_width + 3.0
    land = np.array([far, far + 2, far + 5, far + 10, 20, 28, 36])
    strips = (
        (Material.ASPHALT, np.linspace(-half, half, 5)),
        (Material.PAVING, np.array([half, half + 0.02, far])),
        (Material.PAVING, np.array([-far, -half - 0.02, -half])),
        (Material.GRASS, land),
        (Material.GRASS, -land[::-1]),
    )
    return [(material, _strip(road, left, generator)) for material, left in strips]


def _strip(road: Road, left: Metres, generator: np.random.Generator) -> Mesh:
    s, across = np.meshgrid(np.arange(len(road.s)), left, indexing="ij")
    heading, aside = road.heading[s], np.abs(across)
    camber = 0.05 * (1 - (across / road.half_width) ** 2).clip(0.0)
    lifted = np.where(aside > road.half_width, road.kerb[s], 0.0)
    rough = 0.03 * generator.standard_normal(s.shape) * (aside > road.half_width + 3.5)
    x, y = road.x[s] - across * np.sin(heading), road.y[s] + across * np.cos(heading)
    surface = np.stack([x, y, road.z[s] + camber + lifted + rough], axis=-1)
    return sheet(surface, (0, 0, -0.2))


def _frontage(
    road: Road, joins: list[float], side: int, mixture: Float64[np.ndarray, "3"], draw: Draw
) -> list[Part]:
    """Plot after plot along one side, leaving the side roads open, and a loose row behind."""
    plots, s = (_town_house, _garden_house, _park), 0.0
    turn_deg = 90 - 90 * side  # plots have the street along x, the land towards +y
    parts: list[Part] = []
    ends = [*(join - 4.5 for join in joins), float(road.s[-1])]
    while ends:
        length = min(draw(9.0, 16.0), ends[0] - s)
        if length < 6.0:
            s = ends.pop(0) + 9.0
            continue
        plot = plots[draw.generator.choice(3, p=mixture)](length, draw)
        parts += road.stand(plot, s + length / 2, side * (road.half_width + 3.0), turn_deg)
        s += length
    for s in np.arange(5.0, road.s[-1], 11.0).tolist():
        behind = draw.pick((_garden_house, _tree_pair, _tree_pair))(11.0, draw)
        parts += road.stand(behind, s, side * draw(20.0, 26.0), turn_deg)
    return parts


def _tree_pair(length: float, draw: Draw) -> list[Part]:
    trees = [_set(_tree(draw), (x * length, draw(0.0, 5.0), 0)) for x in (-0.25, 0.25)]
    return trees[0] + trees[1]


def _town_house(length: float, draw: Draw) -> list[Part]:
    """A block of flats: its windows are recesses between piers and floor bands."""
    floors, storey, pane, depth = draw.whole(2, 5), draw(2.9, 3.4), draw(1.0, 1.4), draw(8.0, 12.0)
    height, axes = floors * storey + 0.6, int(length // draw(2.2, 3.0))
    x = np.linspace(-length / 2, length / 2, 2 * axes + 1).tolist()  # piers, windows in between
    levels = [max(floor * storey - 0.2, 0.0) for floor in range(floors + 1)]
    windows = [(at, z + 1.1) for z in levels[:-1] for at in x[1::2]]
    balconies = [(at, z) for at, z in windows if z > 2 and draw.chance(0.15)]
    masonry = [
        (length, depth, height, 0, depth / 2 + 0.3, 0),
        (length + 0.3, depth + 0.6, 0.3, 0, depth / 2, height),
        *((length / axes - pane, 0.3, height, at, 0.15, 0) for at in x[::2]),
        *((length, 0.28, 1.1, 0, 0.16, z) for z in levels),
        *((pane + 0.8, 1, 1.1, at, -0.5, z - 1.1) for at, z in balconies),
    ]
    parts = [
        (draw.pick((Material.PLASTER, Material.PLASTER, Material.BRICK)), boxes(*masonry)),
        (Material.GLASS, boxes(*((pane, 0.04, storey - 1.1, at, 0.27, z) for at, z in windows))),
        (Material.BARK, boxes((1.3, 0.1, 2.3, draw(-0.3, 0.3) * length, -0.02, 0))),
    ]
    return _set(parts, (0, draw(0.0, 1.2), 0))


def _garden_house(length: float, draw: Draw) -> list[Part]:
    """A gabled house behind a fence or hedge, with a tree and bushes in its garden."""
    width, depth, eaves = length * draw(0.55, 0.75), draw(7.0, 9.0), draw(3.0, 5.5)
    rise, setback = draw(2.0, 3.5), draw(3.0, 6.0)
    panes = [
        (1.2, 0.08, 1.2, x * width, -0.03, z)
        for x in (-0.35, 0.35)
        for z in np.arange(1.0, eaves - 1.2, 2.7).tolist()
    ]
    walls = boxes(
        (width, depth, eaves, 0, depth / 2, 0),
        (0.7, 0.7, eaves + rise - 1, width / 4, 0.6 * depth, 1.5),
        (2.0, 1.4, 2.5, draw(-0.2, 0.2) * width, -0.6, 0),
    )
    roof = boxes((width + 0.8, depth + 1, rise, 0, depth / 2, eaves), taper=(1, 0.02))
    house = [(Material.PLASTER, walls), (Material.BRICK, roof), (Material.GLASS, boxes(*panes))]
    border = _fence if draw.chance(0.6) else _hedge
    return [
        *_set(house, (draw(-0.1, 0.1) * length, setback, 0)),
        *border(0.75 * length, draw),
        *_set(_bush(draw), (draw(-0.4, 0.4) * length, draw(1.2, setback - 1), 0)),
        *_set(_tree(draw), (draw(-0.45, 0.45) * length, setback - 1.2, 0)),
    ]


def _park(length: float, draw: Draw) -> list[Part]:
    """Trees and bushes on open ground, sometimes behind a fence."""
    parts = _fence(length, draw) if draw.chance(0.4) else []
    for maker in (*(_tree,) * 5, *(_bush,) * 6):
        parts += _set(maker(draw), (draw(-0.5, 0.5) * length, draw(1.0, 16.0), 0))
    return parts


def _fence(length: float, draw: Draw) -> list[Part]:
    height, end = draw(0.9, 1.4), length / 2
    pales = [(0.09, 0.03, height, x, 0.1, 0) for x in np.arange(-end, end, 0.22).tolist()]
    rails = [(length, 0.05, 0.08, 0, 0.14, height * z) for z in (0.25, 0.8)]
    return [(Material.BARK, boxes(*pales, *rails))]


def _hedge(length: float, draw: Draw) -> list[Part]:
    height, count = draw(1.0, 1.8), int(length / 1.1) + 1
    crowns = [
        place(foliage((0.9, 0.5, height / 2), 160, 0.16, generator=draw.generator), (x, 0.6, 0))
        for x in spaced(-length / 2, length / 2, count)
    ]
    return [(Material.LEAF, join(*crowns, boxes((length, 0.4, 0.8 * height, 0, 0.6, 0))))]


def _tree(draw: Draw) -> list[Part]:
    stem, radius, height, thick = draw(2.0, 3.2), draw(1.5, 2.8), draw(1.8, 3.2), draw(0.12, 0.25)
    crown = foliage((radius, radius, height), int(180 * radius), 0.3, generator=draw.generator)
    trunk = lathe([(thick, 0), (thick / 2, stem + height)], sides=8)
    return [(Material.BARK, trunk), (Material.LEAF, place(crown, (0, 0, stem)))]


def _bush(draw: Draw) -> list[Part]:
    radii = (draw(0.5, 1.1), draw(0.5, 1.1), draw(0.5, 1.1))
    return [(Material.LEAF, foliage(radii, 220, 0.16, generator=draw.generator))]


def foliage(
    radii: tuple[Real, Real, Real], count: int, size: float, *, generator: np.random.Generator
) -> Mesh:
    """Leaves: ``count`` loose triangles of about ``size`` in an ellipsoid standing on z = 0.

    Rays find their way between the leaves, as they do in a real tree.
    """
    directions = generator.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = generator.uniform(0.25, 1.0, (count, 1)) ** 0.5  # leaves sit near the outside
    centres = directions * depth * radii + [0.0, 0.0, radii[2]]
    corners = centres[:, None] + size * generator.standard_normal((count, 3, 3)) / 2
    faces = np.arange(3 * count, dtype=np.int64).reshape(count, 3)
    return Mesh(corners.reshape(-1, 3), faces)


def _kerbside(road: Road, joins: list[float], side: int, draw: Draw) -> list[Part]:
    """Parked cars, street trees, lamp posts, signs, bins and people along one side."""
    parts: list[Part] = []
    occupied, planted = draw(0.3, 0.85), draw(0.1, 0.8)
    for s in np.arange(3.0, road.s[-1] - 3.0, 6.2).tolist():
        if any(abs(s - join) < 8.0 for join in joins):
            continue
        if draw.chance(occupied):
            left, turn_deg = side * (road.half_width - draw(0.9, 1.1)), draw(-2, 2) - 90 * side
            parts += road.stand(_car(draw), s + draw(-0.6, 0.6), left, turn_deg)
        if draw.chance(0.6 * planted):
            parts += road.stand(_tree(draw), s + 3.0, side * (road.half_width + 0.8))
        if draw.chance(0.55):
            left = side * (road.half_width + draw(0.5, 2.3))
            parts += road.stand(_thing(draw), s + 1.5, left, 90 * side)
    return parts


def _car(draw: Draw) -> list[Part]:
    """A car with its number plate behind; its front to -y."""
    body, windows, wheels = car_parts(draw)
    plate = boxes((0.5, 0.02, 0.11, 0, float(body.vertices[:, 1].max()) + 0.01, 0.45))
    return [
        (Material.PAINT, body),
        (Material.GLASS, windows),
        (Material.RUBBER, wheels),
        (Material.SIGN, plate),
    ]


def _thing(draw: Draw) -> list[Part]:
    """A person, a lamp post, a sign or a bin; what is flat faces along the road, across x."""
    if draw.chance(0.25):
        return [(Material.LEAF, make("person", draw))]
    tall, high, (wide, deep) = draw(5.0, 8.0), draw(1.9, 2.4), draw.pick(((0.6, 0.6), (0.9, 0.35)))
    lamp = join(lathe([(0.1, 0), (0.06, tall)], 8), boxes((1.4, 0.12, 0.12, -0.6, 0, tall)))
    post, plate = rod((0, 0, 0), (0, 0, high + 0.6), 0.035), (wide, 0.03, deep, 0, 0.05, high)
    things: tuple[list[Part], ...] = (
        [(Material.METAL, lamp)],
        [(Material.METAL, post), (Material.SIGN, boxes(plate))],
        [(Material.RUBBER, boxes((0.55, 0.6, draw(0.9, 1.2), 0, 0, 0)))],
    )
    return draw.pick(things)
