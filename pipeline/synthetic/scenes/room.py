"""Furnished rooms of random size and layout: which furniture stands where, between which walls."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.scenes import furniture as make
from pipeline.synthetic.scenes.rays import ball, box, merged, placed

KINDS = ("kitchen", "office", "bedroom", "lounge", "study", "hotel", "dining", "workshop")
_AT_THE_WALL: dict[str, tuple[make.Maker, ...]] = {
    "kitchen": (make.kitchen_counter, make.fridge, make.kitchen_counter, make.sideboard),
    "office": (make.desk, make.desk, make.bookshelf, make.wardrobe, make.desk),
    "bedroom": (make.bed, make.wardrobe, make.nightstand, make.sideboard, make.desk),
    "lounge": (make.sofa, make.sideboard, make.armchair, make.bookshelf, make.armchair),
    "study": (make.desk, make.bookshelf, make.bookshelf, make.bookshelf, make.armchair),
    "hotel": (make.bed, make.nightstand, make.desk, make.wardrobe, make.armchair),
    "dining": (make.sideboard, make.bookshelf, make.fridge, make.sofa, make.sideboard),
    "workshop": (make.desk, make.bookshelf, make.kitchen_counter, make.cartons, make.wardrobe),
}
_IN_THE_MIDDLE: dict[str, make.Maker] = {
    "kitchen": make.dining_table,
    "office": make.dining_table,
    "bedroom": make.cartons,
    "lounge": make.coffee_table,
    "study": make.coffee_table,
    "hotel": make.coffee_table,
    "dining": make.dining_table,
    "workshop": make.dining_table,
}
_SMALL = (make.floor_lamp, *(make.plant, make.cartons, make.waste_bin, make.cartons) * 2)
_WALL = 0.2  # thickness

Rectangle = tuple[float, float, float, float]
"""(x from, y from, x to, y to) on the floor."""


@dataclass(frozen=True)
class Room:
    """A room with its floor at z = 0, reaching from (0, 0) to (width, depth)."""

    kind: str
    width: float
    depth: float
    mesh: Mesh


def sample_room(kind: str, *, generator: np.random.Generator) -> Room:
    """Build and furnish one room of a kind out of ``KINDS``; metres."""
    width, depth = generator.uniform(3.9, 5.2), generator.uniform(3.3, 4.4)
    height = generator.uniform(2.4, 2.8)
    parts = [
        placed(box(width, depth, _WALL), width / 2, depth / 2, -_WALL),
        placed(box(width, depth, _WALL), width / 2, depth / 2, height),
    ]
    door = int(generator.integers(4))
    for wall in range(4):
        mesh = _wall((width, depth)[wall % 2], height, wall == door, generator)
        parts.append(_at_wall(mesh, wall, 0.0, (width, depth)))
    taken = [_door_swing(door, (width, depth))]
    for maker in (_pillar, *_AT_THE_WALL[kind], *_SMALL):
        piece = _stand(maker(generator), (width, depth), taken, generator)
        parts += [] if piece is None else [piece]
    middle = placed(_IN_THE_MIDDLE[kind](generator), 0.0, -0.7)
    x, y = generator.uniform(0.42, 0.58) * width, generator.uniform(0.42, 0.58) * depth
    parts.append(placed(middle, x, y, 0.0, generator.uniform(-np.pi, np.pi)))
    return Room(kind, width, depth, merged(parts))


def _at_wall(mesh: Mesh, wall: int, along: float, floor: tuple[float, float]) -> Mesh:
    """Put a piece with its back against a wall, ``along`` metres from the middle of the wall.

    Walls 0 to 3 are the front (y = 0), right, back and left one; +y of the piece points inwards.
    """
    width, depth = floor
    x, y = ((width / 2, 0.0), (width, depth / 2), (width / 2, depth), (0.0, depth / 2))[wall]
    yaw = wall * np.pi / 2
    return placed(mesh, x + along * np.cos(yaw), y + along * np.sin(yaw), 0.0, yaw)


def _footprint(mesh: Mesh) -> Rectangle:
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return float(lower[0]), float(lower[1]), float(upper[0]), float(upper[1])


def _overlap(a: Rectangle, b: Rectangle) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _door_swing(wall: int, floor: tuple[float, float]) -> Rectangle:
    """The floor before a door, to be kept free."""
    return _footprint(_at_wall(placed(box(1.0, 0.8, 1.0), 0.0, 0.4), wall, 0.0, floor))


def _stand(
    piece: Mesh, floor: tuple[float, float], taken: list[Rectangle], generator: np.random.Generator
) -> Mesh | None:
    """Find the piece a free place at some wall and take it; None where the room is full."""
    half = float(np.abs(piece.vertices[:, 0]).max())
    for _ in range(40):
        wall = int(generator.integers(4))
        reach = floor[wall % 2] / 2 - half - 0.03
        if reach <= 0:
            continue
        stood = _at_wall(piece, wall, generator.uniform(-reach, reach), floor)
        footprint = _footprint(stood)
        if not any(_overlap(footprint, other) for other in taken):
            taken.append(footprint)
            return stood
    return None


def _pillar(generator: np.random.Generator) -> Mesh:
    """A chimney breast: it makes even an empty room asymmetric."""
    width, depth = generator.uniform(0.4, 1.0), generator.uniform(0.15, 0.4)
    return placed(box(width, depth, 2.8), 0.0, depth / 2)


def _wall(length: float, height: float, has_door: bool, generator: np.random.Generator) -> Mesh:
    """A wall along x with its inner face on y = 0: a door, or a window over a radiator, pictures."""
    if has_door:
        left, right, low, high = -0.45, 0.45, 0.0, 2.05
        inside = [
            placed(box(0.9, 0.04, 2.05), 0.0, -0.1),
            placed(ball(0.03, 0.03, 0.03), 0.38, -0.06, 1.0),
        ]
    else:
        middle, half = generator.uniform(-0.2, 0.2) * length, generator.uniform(0.4, 0.8)
        left, right, low, high = middle - half, middle + half, 0.9, generator.uniform(1.9, 2.2)
        inside = [placed(m, middle, 0.0) for m in _window(half, low, high)]
    end, back = length / 2 + _WALL, -_WALL / 2
    masonry = [
        placed(box(left + end, _WALL, height), (left - end) / 2, back),
        placed(box(end - right, _WALL, height), (right + end) / 2, back),
        placed(box(right - left, _WALL, height - high), (left + right) / 2, back, high),
    ]
    if low > 0:
        masonry.append(placed(box(right - left, _WALL, low), (left + right) / 2, back))
    return merged(masonry + inside + _pictures(length, generator))


def _window(half: float, low: float, high: float) -> list[Mesh]:
    """Pane, frame, sill and the radiator below, centred in x."""
    height = high - low
    posts = [
        placed(box(0.06, 0.06, height), x, -0.14, low) for x in (-half + 0.03, 0.0, half - 0.03)
    ]
    rails = [placed(box(2 * half, 0.06, 0.06), 0.0, -0.14, z) for z in (low, high - 0.06)]
    ribs = [placed(box(0.05, 0.09, 0.55), x, 0.07, 0.12) for x in np.arange(-0.4, 0.41, 0.08)]
    pane = placed(box(2 * half, 0.02, height), 0.0, -0.16, low)
    sill = placed(box(2 * half + 0.1, 0.16, 0.03), 0.0, 0.02, low - 0.03)
    return [pane, sill, *posts, *rails, *ribs]


def _pictures(length: float, generator: np.random.Generator) -> list[Mesh]:
    """A picture or a hanging cupboard left and right, clear of the opening in the middle."""
    parts = []
    for side in (-1.0, 1.0):
        width, height = generator.uniform(0.3, 0.7, 2)
        thickness = 0.05 if generator.random() < 0.5 else generator.uniform(0.15, 0.3)
        x = side * (length / 2 - generator.uniform(0.35, 0.6))
        thing = box(width, thickness, height)
        parts.append(placed(thing, x, thickness / 2, generator.uniform(1.35, 1.7)))
    return parts


def sample_camera_path(
    room: Room, frames: int, turn: float, *, generator: np.random.Generator
) -> Float64[np.ndarray, "frames 4 4"]:
    """Walk a camera round the room, turning by ``turn`` radians a frame.

    The walk circles the middle of the room at eye height and looks across it, up and down and
    aside in slow waves that do not repeat, so a second round sees other views.

    Returns:
        T_room_camera of every frame: x right, y down, z along the line of sight.
    """
    around = generator.choice([-1.0, 1.0]) * (np.arange(frames) * turn) + generator.uniform(0, 6.28)
    wave = [
        np.sin(around * rate + phase)
        for rate, phase in zip(
            generator.uniform(0.6, 1.9, 6), generator.uniform(0, 2 * np.pi, 6), strict=True
        )
    ]
    radius = 0.22 + 0.04 * wave[0]
    position = np.column_stack(
        [
            room.width * (0.5 + radius * np.cos(around)),
            room.depth * (0.5 + radius * np.sin(around)),
            1.5 + 0.15 * wave[1],
        ]
    )
    heading = around + np.pi + 0.35 * wave[2] + 0.2 * wave[3]
    pitch, roll = -0.38 + 0.2 * wave[4], 0.08 * wave[5]
    return np.stack([_look(*view) for view in zip(position, heading, pitch, roll, strict=True)])


def _look(
    position: Float64[np.ndarray, "3"], heading: float, pitch: float, roll: float
) -> Float64[np.ndarray, "4 4"]:
    """The pose of a camera looking along ``heading``, up by ``pitch``, rolled; radians."""
    forward = np.array(
        [np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), np.sin(pitch)]
    )
    level = np.array([np.sin(heading), -np.cos(heading), 0.0])
    under = np.cross(forward, level)
    right = np.cos(roll) * level + np.sin(roll) * under
    T_room_camera = np.eye(4)
    T_room_camera[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    T_room_camera[:3, 3] = position
    return T_room_camera
