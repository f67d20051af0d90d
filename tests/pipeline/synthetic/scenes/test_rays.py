"""Solids are closed and of the right size; rays meet them where geometry says."""

import numpy as np
import pytest

from pcrdiff.data.raw import Mesh
from pipeline.synthetic.scenes.rays import RayScene, box, frustum, leaves, merged, placed, tapered


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


SOLIDS = {
    "box": (box(1.0, 2.0, 3.0), 6.0),
    "wedge": (tapered((2.0, 1.0), (2.0, 0.0), 3.0), 3.0),
    "cylinder": (frustum(1.0, 1.0, 2.0, sides=400), 2 * np.pi),
    "cone": (frustum(1.0, 0.0, 3.0, sides=400), np.pi),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_closed_and_faces_outwards(name: str) -> None:
    mesh, expected = SOLIDS[name]
    edges = np.concatenate([mesh.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    forward, backward = {tuple(e) for e in edges.tolist()}, {tuple(e) for e in edges[:, ::-1]}
    assert len(forward) == len(edges)
    assert forward == {(int(a), int(b)) for a, b in backward}
    assert volume(mesh) == pytest.approx(expected, rel=1e-3)


def test_placing_turns_counter_clockwise_before_it_moves() -> None:
    mesh = placed(
        Mesh(np.array([[1.0, 0.0, 0.0]]), np.zeros((0, 3), np.int64)), 5.0, 0.0, 2.0, np.pi / 2
    )
    np.testing.assert_allclose(mesh.vertices, [[5.0, 1.0, 2.0]], atol=1e-12)


def test_merging_keeps_every_triangle() -> None:
    parts = [box(1.0, 1.0, 1.0), placed(frustum(1.0, 0.5, 2.0), 9.0, 0.0)]
    assert volume(merged(parts)) == pytest.approx(sum(volume(part) for part in parts))


def test_rays_report_distance_part_and_angle() -> None:
    scene = RayScene([placed(box(2.0, 2.0, 2.0), 5.0, 0.0, -1.0), box(0.1, 9.0, 0.1)])
    hits = scene.cast(np.array([1.0, 0.5, 0.5]), np.array([[2.0, 0.0, 0.0], [0, 0, 1.0]]))
    np.testing.assert_allclose(hits.distance, [1.5, np.inf])
    assert hits.part.tolist() == [0, -1]
    assert hits.cosine[0] == pytest.approx(1.0)
    slanted = scene.cast(np.array([1.0, 0.0, 0.0]), np.array([[1.0, 0.2, 0.0]]))
    assert slanted.cosine[0] == pytest.approx(1 / np.hypot(1.0, 0.2))


def test_leaves_stay_in_their_crown_and_let_some_rays_through() -> None:
    crown = leaves((2.0, 1.0, 1.5), 200, 0.1, generator=np.random.default_rng(0))
    lower, upper = crown.vertices.min(axis=0), crown.vertices.max(axis=0)
    assert (lower > [-2.3, -1.3, -0.3]).all()
    assert (upper < [2.3, 1.3, 3.3]).all()
    y, z = np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(1.0, 2.0, 40))
    directions = np.column_stack([np.full(1600, 8.0), y.reshape(-1), z.reshape(-1) - 1.5])
    met = RayScene([crown]).cast(np.array([-8.0, 0.0, 1.5]), directions).part == 0
    assert 0.05 < met.mean() < 0.95
