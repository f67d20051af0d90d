"""Rooms of every kind are furnished, and a camera can walk through them."""

import numpy as np
import pytest

from pipeline.synthetic.scenes.rays import RayScene
from pipeline.synthetic.scenes.room import KINDS, Room, sample_camera_path, sample_room


@pytest.mark.parametrize("kind", KINDS)
def test_a_room_keeps_within_its_walls_and_holds_furniture(kind: str) -> None:
    room = sample_room(kind, generator=np.random.default_rng(4))
    lower, upper = room.mesh.vertices.min(axis=0), room.mesh.vertices.max(axis=0)
    assert (lower > -0.21).all()
    assert (upper < [room.width + 0.21, room.depth + 0.21, 3.1]).all()
    inside = (room.mesh.vertices > [0.1, 0.1, 0.1]) & (
        room.mesh.vertices < [room.width - 0.1, room.depth - 0.1, 2.2]
    )
    assert inside.all(axis=1).sum() > 500


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [9, 17, 23])
def test_the_camera_never_touches_the_furniture(kind: str, seed: int) -> None:
    generator = np.random.default_rng(seed)
    room = sample_room(kind, generator=generator)
    path = sample_camera_path(room, 60, 0.1, generator=generator)
    rays = RayScene([room.mesh])
    directions = np.random.default_rng(0).standard_normal((300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    clearance = min(rays.cast(T[:3, 3], directions).distance.min() for T in path)
    assert clearance > 0.2


def test_a_camera_path_is_rigid_smooth_and_level() -> None:
    room = Room("study", 5.0, 4.0, sample_room("study", generator=np.random.default_rng(0)).mesh)
    path = sample_camera_path(room, 50, 0.1, generator=np.random.default_rng(2))
    R = path[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    assert np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1).max() < 0.2
    turned = np.trace(R[:-1].transpose(0, 2, 1) @ R[1:], axis1=1, axis2=2)
    assert np.arccos(np.clip((turned - 1) / 2, -1, 1)).max() < 0.3
    assert R[:, 2, 1].max() < -0.7  # the image's y axis points down


def test_two_draws_are_two_rooms() -> None:
    first, second = (sample_room("office", generator=np.random.default_rng(n)) for n in (0, 1))
    assert (first.width, first.depth) != (second.width, second.depth)
