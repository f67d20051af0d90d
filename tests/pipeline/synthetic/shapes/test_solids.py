"""Solids are closed and of the right size, and go where they are put."""

import numpy as np
import pytest

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.shapes.solids import (
    Axis,
    arc,
    ball,
    both_sides,
    boxes,
    cushion,
    disc,
    four,
    hollow,
    join,
    lathe,
    loft,
    place,
    rod,
    sheet,
    slab,
    smooth,
    stretch,
    tube,
    turn,
)

POINT = Mesh(np.array([[1.0, 0.0, 0.0]]), np.zeros((0, 3), np.int64))
SOLIDS = {
    "box": (boxes((1, 2, 3, 0, 0, 0)), 6.0),
    "boxes": (boxes((1, 2, 3, 0, 0, 0), (1, 1, 1, 5, 0, 0)), 7.0),
    "wedge": (boxes((2, 1, 3, 0, 0, 0), taper=(1, 0)), 3.0),
    "frustum": (boxes((2, 2, 3, 0, 0, 0), taper=(0.5, 0.5)), 7.0),
    "cylinder": (lathe([(1, 0), (1, 2)], sides=400), 2 * np.pi),
    "cone": (lathe([(1, 0), (0, 3)], sides=400), np.pi),
    "hollow": (hollow([(1, 0), (1, 1)], 0.5, 0.5, sides=400), np.pi * (1 - 0.49 / 6)),
    "ellipsoid": (ball((1, 2, 3), (5, 5, 5), sides=200), 8 * np.pi),
    "loft": (loft([(2, 4, 0, 0, 0), (2, 4, 0, 0, 3)], sides=400), 6 * np.pi),
    "rod": (rod((0, 0, 0), (0, 3, 4), 0.1), 5 * 0.01 * 5 * np.sin(2 * np.pi / 10)),
    "disc": (disc("x", 2, 0.5, (1, 1, 1), sides=400), 2 * np.pi),
    "bent tube": (tube([(0, 0, 0), (0, 0, 1), (0, 1, 1)], 0.01), None),
    "cushion": (cushion((1, 1, 1), (0, 0, 0)), None),
    "slab": (slab([(0, 0), (2, 0), (0, 2)], (1, 4), "y"), 6.0),
    "sheet": (
        sheet(np.stack(np.meshgrid([0.0, 1, 2], [0.0, 1], [0.0]), -1)[:, :, 0], (0, 0, 1)),
        2.0,
    ),
}


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_closed_and_faces_outwards(name: str) -> None:
    mesh, expected = SOLIDS[name]
    _, welded = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)  # at a cone's tip
    faces = welded.reshape(-1)[mesh.faces]
    faces = faces[(np.diff(np.sort(faces), axis=1) > 0).all(axis=1)]
    edges = np.concatenate([faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    forward = {tuple(edge) for edge in edges.tolist()}
    assert len(forward) == len(edges)
    assert forward == {(b, a) for a, b in forward}
    assert volume(mesh) > 0
    if expected is not None:
        assert volume(mesh) == pytest.approx(expected, rel=2e-3)


def test_placing_turns_counter_clockwise_before_it_moves() -> None:
    np.testing.assert_allclose(place(POINT, (5, 0, 2), 90).vertices, [[5, 1, 2]], atol=1e-12)
    np.testing.assert_allclose(place(POINT, (5, 0, 2)).vertices, [[6, 0, 2]])


@pytest.mark.parametrize(
    ("axis", "expected"), [("x", [1, 0, 0]), ("y", [0, 0, -1]), ("z", [0, 1, 0])]
)
def test_a_turn_is_right_handed(axis: Axis, expected: list[float]) -> None:
    np.testing.assert_allclose(turn(POINT, axis, 90).vertices[0], expected, atol=1e-12)


def test_a_turn_about_a_line_leaves_the_line_where_it_is() -> None:
    turned = turn(POINT, "z", 70, about=(1, 0, 9))
    np.testing.assert_allclose(turned.vertices, POINT.vertices, atol=1e-12)


def test_joining_keeps_every_triangle() -> None:
    parts = [boxes((1, 1, 1, 0, 0, 0)), lathe([(1, 9), (0.5, 11)])]
    assert volume(join(*parts)) == pytest.approx(sum(volume(part) for part in parts))


def test_a_mirror_image_faces_outwards_too() -> None:
    wedge = slab([(1, 0), (2, 0), (1, 3)], (0, 1), "y")
    assert volume(stretch(wedge, (-1, 1, 1))) == pytest.approx(1.5)
    assert volume(both_sides(wedge)) == pytest.approx(3.0)
    assert volume(four(wedge)) == pytest.approx(6.0)
    assert both_sides(wedge).vertices[:, 0].min() == pytest.approx(-2.0)


def test_a_box_stands_on_the_middle_of_its_underside() -> None:
    vertices = boxes((2, 4, 6, 10, 20, 30)).vertices
    np.testing.assert_allclose(vertices.min(axis=0), [9, 18, 30])
    np.testing.assert_allclose(vertices.max(axis=0), [11, 22, 36])


def test_a_smooth_outline_passes_through_its_knots_and_not_beyond_them() -> None:
    knots = [(0.0, 0.0), (2.0, 1.0), (1.0, 2.0)]
    rounded = smooth(knots, 21)
    np.testing.assert_allclose(rounded[[0, 10, 20]], knots)
    assert rounded[:, 0].max() <= 2.0


def test_an_arc_counts_from_the_first_axis_towards_the_second() -> None:
    np.testing.assert_allclose(arc(2, 0, 90, 2), [[2, 0], [0, 2]], atol=1e-12)
