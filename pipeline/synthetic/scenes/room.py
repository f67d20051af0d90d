"""Furnished rooms of random size and layout: which furniture stands where, between which walls."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.shapes.cabinets import cabinet
from pipeline.synthetic.shapes.makers import make
from pipeline.synthetic.shapes.solids import Row, boxes, join, lathe, place, stretch, turn

_AT_THE_WALL = {
    "kitchen": ("counter", "fridge", "counter", "dresser"),
    "office": ("workplace", "workplace", "bookshelf", "wardrobe", "workplace"),
    "bedroom": ("bed", "wardrobe", "night_stand", "dresser", "workplace"),
    "lounge": ("sofa", "tv_stand", "sofa", "bookshelf", "piano"),
    "study": ("workplace", "bookshelf", "bookshelf", "bookshelf", "sofa"),
    "hotel": ("bed", "night_stand", "workplace", "wardrobe", "bench"),
    "dining": ("tv_stand", "bookshelf", "fridge", "sofa", "dresser"),
    "workshop": ("workplace", "bookshelf", "counter", "cartons", "wardrobe"),
}
KINDS = tuple(_AT_THE_WALL)
_DINING = ("kitchen", "office", "dining", "workshop")
"""Kinds with chairs at the table in their middle."""
_SMALL = ("lamp", *("plant", "cartons", "bin", "cartons") * 2)
_STREWN = ("bottle", "bowl", "cup", "flower_pot", "laptop", "radio", "vase", "carton", "carton")
_WALL = 0.2  # thickness
_WALK, _WAVER = 0.22, 0.04  # the radius of the camera's walk, and how far it strays; in rooms
_HEADROOM, _ELBOWROOM = 1.1, 0.09  # what is higher, in metres, stays so far off it, in rooms

Rectangle = Float64[np.ndarray, "2 2"]
"""The least x and y on the floor, then the greatest."""


@dataclass(frozen=True)
class Room:
    """A room with its floor at z = 0, reaching from (0, 0) to (width, depth)."""

    kind: str
    width: float
    depth: float
    mesh: Mesh


def sample_room(kind: str, *, generator: np.random.Generator) -> Room:
    """Build and furnish one room of a kind out of ``KINDS``; metres."""
    draw = Draw(generator)
    width, depth, height, door = draw(3.9, 5.2), draw(3.3, 4.4), draw(2.4, 2.8), draw.whole(0, 3)
    floor = (width, depth)
    parts = [boxes(*((width, depth, _WALL, width / 2, depth / 2, z) for z in (-_WALL, height)))]
    for wall in range(4):
        parts.append(_at_wall(_wall(floor[wall % 2], height, wall == door, draw), wall, 0.0, floor))
    taken = [_footprint(_at_wall(boxes((1, 0.8, 1, 0, 0.4, 0)), door, 0.0, floor))]  # its swing
    for name in ("chimney", *_AT_THE_WALL[kind], *_SMALL):
        piece = _stand(_piece(name, draw), floor, taken, draw)
        parts += [] if piece is None else [piece]
    at = (draw(0.42, 0.58) * width, draw(0.42, 0.58) * depth, 0)
    parts.append(place(_group(kind, draw), at, draw(-180, 180)))
    return Room(kind, width, depth, join(*parts))


def _piece(name: str, draw: Draw) -> Mesh:
    """Something that stands at a wall: on z = 0, its back on y = 0, reaching into the room (+y)."""
    turned = _grounded(turn(_made(name, draw), "z", 180))
    return place(turned, (0, np.ptp(turned.vertices[:, 1]) / 2, 0))


def _made(name: str, draw: Draw) -> Mesh:
    """A shape of ModelNet40 or one that only rooms have; the front towards -y."""
    if name in ("counter", "fridge"):
        return cabinet(name, draw)
    own = {"bin": _bin, "carton": _carton, "cartons": _cartons, "workplace": _workplace}
    if name == "chimney":  # it makes even an empty room asymmetric
        return boxes((draw(0.4, 1.0), draw(0.15, 0.4), 2.8, 0, 0, 0))
    return own[name](draw) if name in own else make(name, draw)


def _grounded(mesh: Mesh) -> Mesh:
    """The mesh on z = 0, its middle over the origin."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return place(mesh, np.array([*-(low + high)[:2] / 2, -low[2]]))


def _on(base: Mesh, thing: Mesh, x: float, y: float, yaw_deg: float) -> Mesh:
    """A thing on top of whatever of ``base`` is highest at (x, y); ``base`` alone if nothing is."""
    down = RayScene([base]).cast(np.array([x, y, 9.0]), np.array([[0.0, 0.0, -1.0]]))
    if not np.isfinite(down.distance[0]):
        return base
    return join(base, place(_grounded(thing), (x, y, 9.0 - down.distance[0]), yaw_deg))


def _strewn(base: Mesh, count: int, draw: Draw) -> Mesh:
    """Furniture with small things on it."""
    low, high = _footprint(base)
    for _ in range(count):
        x, y = (low + draw.generator.uniform(0.1, 0.9, 2) * (high - low)).tolist()
        base = _on(base, _made(draw.pick(_STREWN), draw), x, y, draw(-180, 180))
    return base


def _bin(draw: Draw) -> Mesh:
    return lathe([(draw(0.1, 0.14), 0), (draw(0.14, 0.18), draw(0.3, 0.6))])


def _carton(draw: Draw) -> Mesh:
    return boxes((draw(0.1, 0.3), draw(0.1, 0.3), draw(0.1, 0.3), 0, 0, 0))


def _cartons(draw: Draw) -> Mesh:
    """Moving boxes, piled up to three high."""
    pile = boxes((0.4, 0.35, draw(0.25, 0.45), 0, 0, 0))
    for _ in range(draw.whole(0, 2)):
        pile = _on(pile, stretch(_carton(draw), (1.5, 1.5, 1.5)), 0.0, 0.0, draw(-25, 25))
    return pile


def _low(mesh: Mesh) -> Mesh:
    """The mesh on z = 0, and so low that the camera looks over it."""
    stood = _grounded(mesh)
    return stretch(stood, (1, 1, min(1.0, _HEADROOM / float(stood.vertices[:, 2].max()))))


def _workplace(draw: Draw) -> Mesh:
    """A desk with a monitor, a keyboard, small things and a chair."""
    desk, x = _grounded(make("desk", draw)), draw(-0.3, 0.3)
    desk = _on(desk, make("monitor", draw), x, 0.05, draw(-20, 20))
    desk = _on(desk, make("keyboard", draw), x, -0.2, draw(-6, 6))
    chair = place(_low(make("chair", draw)), (x, -0.75, 0), draw(120, 240))
    return join(_strewn(desk, 5, draw), chair)


def _group(kind: str, draw: Draw) -> Mesh:
    """What stands in the middle: cartons beside a bed, else a laid table, with chairs or without."""
    if "bed" in _AT_THE_WALL[kind]:
        return _cartons(draw)
    table = _grounded(make("table", draw))
    width, depth = np.ptp(table.vertices[:, :2], axis=0).tolist()
    group = _strewn(table, 6, draw)
    seats = [(x * width, side) for x in (-0.25, 0.25) for side in (-1, 1)]
    for x, side in seats[: draw.whole(2, 4) if kind in _DINING else 0]:
        at = (x, side * (depth / 2 + draw(0.05, 0.35)), 0)
        group = join(group, place(make("chair", draw), at, 90 - 90 * side + draw(-25, 25)))
    return _low(group)


def _at_wall(mesh: Mesh, wall: int, along: float, floor: tuple[float, float]) -> Mesh:
    """Put a piece with its back against a wall, ``along`` metres from the middle of the wall.

    Walls 0 to 3 are the front (y = 0), right, back and left one; +y of the piece points inwards.
    """
    width, depth = floor
    x, y = ((width / 2, 0), (width, depth / 2), (width / 2, depth), (0, depth / 2))[wall]
    return place(place(mesh, (along, 0, 0)), (x, y, 0), 90 * wall)


def _footprint(mesh: Mesh) -> Rectangle:
    return np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])[:, :2]


def _overlap(a: Rectangle, b: Rectangle) -> bool:
    return bool((a[0] < b[1]).all() and (b[0] < a[1]).all())


def _stand(
    piece: Mesh, floor: tuple[float, float], taken: list[Rectangle], draw: Draw
) -> Mesh | None:
    """Find the piece a free place at some wall and take it; None where the room is full."""
    half = float(np.abs(piece.vertices[:, 0]).max())
    for _ in range(40):
        wall = draw.whole(0, 3)
        reach = floor[wall % 2] / 2 - half - 0.03
        if reach <= 0:
            continue
        stood = _at_wall(piece, wall, draw(-reach, reach), floor)
        footprint = _footprint(stood)
        if not _in_the_way(stood, floor) and not any(_overlap(footprint, t) for t in taken):
            taken.append(footprint)
            return stood
    return None


def _in_the_way(piece: Mesh, floor: tuple[float, float]) -> bool:
    """Whether the camera might touch the piece on its walk round the room."""
    points = np.concatenate([piece.vertices, piece.vertices[piece.faces].mean(axis=1)])
    high = points[points[:, 2] > _HEADROOM, :2]
    return bool((np.linalg.norm(high / floor - 0.5, axis=1) < _WALK + _WAVER + _ELBOWROOM).any())


def _wall(length: float, height: float, has_door: bool, draw: Draw) -> Mesh:
    """A wall along x with its inner face on y = 0: a door, or a window over a radiator, pictures."""
    if has_door:
        left, right, low, high = -0.45, 0.45, 0.0, 2.05
        rows: list[Row] = [(0.9, 0.04, 2.05, 0, -0.1, 0), (0.06, 0.06, 0.06, 0.38, -0.06, 1.0)]
    else:
        middle, half = draw(-0.2, 0.2) * length, draw(0.4, 0.8)
        left, right, low, high = middle - half, middle + half, 0.9, draw(1.9, 2.2)
        rows = _window(middle, half, high)
    end, wide, middle, back = length / 2 + _WALL, right - left, (left + right) / 2, -_WALL / 2
    rows += [
        (left + end, _WALL, height, (left - end) / 2, back, 0),
        (end - right, _WALL, height, (right + end) / 2, back, 0),
        (wide, _WALL, height - high, middle, back, high),
        (wide, _WALL, low + 0.01, middle, back, 0),
    ]
    for side in (-1, 1):  # a picture or a hanging cupboard, clear of the opening
        thick = 0.05 if draw.chance(0.5) else draw(0.15, 0.3)
        x = side * (length / 2 - draw(0.35, 0.6))
        rows.append((draw(0.3, 0.7), thick, draw(0.3, 0.7), x, thick / 2, draw(1.35, 1.7)))
    return boxes(*rows)


def _window(x: float, half: float, high: float) -> list[Row]:
    """Pane, sill, frame and the radiator below."""
    tall = high - 0.9
    return [
        (2 * half, 0.02, tall, x, -0.16, 0.9),
        (2 * half + 0.1, 0.16, 0.03, x, 0.02, 0.87),
        *((0.06, 0.06, tall, x + at, -0.14, 0.9) for at in (0.03 - half, 0.0, half - 0.03)),
        *((2 * half, 0.06, 0.06, x, -0.14, z) for z in (0.9, high - 0.06)),
        *((0.05, 0.09, 0.55, x + at, 0.07, 0.12) for at in np.arange(-0.4, 0.41, 0.08).tolist()),
    ]


def sample_camera_path(
    room: Room, frames: int, turn: float, *, generator: np.random.Generator
) -> Float64[np.ndarray, "frames 4 4"]:
    """Walk a camera round the room, turning by ``turn`` radians a frame.

    The walk circles the middle of the room at eye height and looks across it, up and down and
    aside in slow waves that do not repeat, so a second round sees other views.

    Returns:
        T_room_camera of every frame: x right, y down, z along the line of sight.
    """
    draw = Draw(generator)
    around = draw.pick((-1, 1)) * turn * np.arange(frames) + draw(0, 2 * np.pi)
    wave = [np.sin(around * draw(0.6, 1.9) + draw(0, 2 * np.pi)) for _ in range(6)]
    radius = _WALK + _WAVER * wave[0]
    x = room.width * (0.5 + radius * np.cos(around))
    y = room.depth * (0.5 + radius * np.sin(around))
    heading = around + np.pi + 0.35 * wave[2] + 0.2 * wave[3]
    pitch, roll = -0.38 + 0.2 * wave[4], 0.08 * wave[5]
    views = zip(x, y, 1.5 + 0.15 * wave[1], heading, pitch, roll, strict=True)
    return np.stack([_look(*view) for view in views])


def _look(
    x: float, y: float, z: float, heading: float, pitch: float, roll: float
) -> Float64[np.ndarray, "4 4"]:
    """The pose of a camera looking along ``heading``, up by ``pitch``, rolled; radians."""
    level, up = np.array([np.sin(heading), -np.cos(heading), 0.0]), np.array([0.0, 0.0, 1.0])
    forward = np.cos(pitch) * np.cross(up, level) + np.sin(pitch) * up
    right = np.cos(roll) * level + np.sin(roll) * np.cross(forward, level)
    T_room_camera = np.eye(4)
    T_room_camera[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T_room_camera[:3, 3] = x, y, z
    return T_room_camera
