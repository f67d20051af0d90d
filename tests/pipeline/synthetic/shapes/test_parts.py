"""Stands reach from the floor to what they carry; fronts stand out towards -y."""

import numpy as np
import pytest

from pcrdiff.clouds.surface import Mesh
from pipeline.synthetic.draw import Draw
from pipeline.synthetic.shapes.parts import (
    LEGS,
    Stand,
    carcass,
    drawers,
    handle,
    knob,
    leaf,
    spaced,
    stand,
    tap,
)

STANDS: tuple[Stand, ...] = (*LEGS, "pedestal", "trestle", "star", "runners")


def bounds(mesh: Mesh) -> tuple[list[float], list[float]]:
    return mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()


@pytest.mark.parametrize("style", STANDS)
def test_a_stand_reaches_from_the_floor_to_its_height(style: Stand) -> None:
    (left, front, low), (right, rear, high) = bounds(stand(style, 0.6, 0.5, 0.4, 0.04))
    assert low == pytest.approx(0, abs=0.02)
    assert high == pytest.approx(0.4, abs=0.03)
    assert 0.2 < right - left < 1.0
    assert 0.2 < rear - front < 1.0


@pytest.mark.parametrize("style", LEGS)
def test_legs_stand_at_four_corners(style: Stand) -> None:
    vertices = stand(style, 0.6, 0.5, 0.4, 0.04).vertices
    corners = {(bool(x > 0), bool(y > 0)) for x, y, _ in vertices}
    assert len(corners) == 4
    assert np.abs(vertices[:, :2]).min() > 0.15


def test_splayed_legs_stand_wider_than_what_they_carry() -> None:
    straight, splayed = (
        bounds(stand(style, 0.6, 0.5, 0.4, 0.04))[1] for style in ("square", "splayed")
    )
    assert splayed[0] > straight[0] + 0.05


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("seed", range(6))
def test_drawers_fill_their_front_and_stand_out_of_it(count: int, seed: int) -> None:
    low, high = bounds(drawers(0.5, 0.6, count, Draw(np.random.default_rng(seed))))
    assert low[1] < -0.06  # one is pulled out
    assert high[1] <= 1e-9
    assert low[2] >= 0
    assert high[2] == pytest.approx(0.6, abs=0.05)
    assert high[0] - low[0] == pytest.approx(0.48)


def test_a_carcass_is_open_in_front() -> None:
    mesh = carcass(1.0, 0.5, 2.0, 0.02)
    low, high = bounds(mesh)
    np.testing.assert_allclose(low, [-0.5, -0.25, 0])
    np.testing.assert_allclose(high, [0.5, 0.25, 2])
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    in_front = np.isclose(np.stack([a, b, c])[..., 1], -0.25).all(axis=0)
    assert areas[in_front].sum() < 0.2  # the edges of four boards, not a front of 2 square metres


def test_knobs_and_handles_stick_out_of_the_front_they_are_on() -> None:
    for part in (knob((0, -0.1, 1), 0.02), handle((-0.1, -0.1, 1), (0.1, -0.1, 1))):
        low, high = bounds(part)
        assert low[1] < -0.12
        assert high[1] <= -0.1 + 0.009


def test_a_leaf_reaches_from_its_base_to_its_tip_and_is_lifted_between() -> None:
    flat, lifted = (leaf((0, 0, 0), (1, 0, 0.5), 0.2, lift) for lift in (0.0, 0.3))
    low, high = bounds(flat)
    assert (low[0], high[0]) == (0, 1)
    assert high[1] - low[1] == pytest.approx(0.2, rel=0.1)
    assert bounds(lifted)[1][2] > high[2] + 0.05


def test_a_tap_stands_on_its_base_and_reaches_forwards() -> None:
    low, high = bounds(tap(0.3, 0.2))
    assert low[1] == pytest.approx(-0.2, abs=0.03)
    assert high[2] == pytest.approx(0.3, abs=0.03)


def test_spaced_numbers_include_both_ends() -> None:
    assert spaced(1, 2, 3) == [1.0, 1.5, 2.0]
