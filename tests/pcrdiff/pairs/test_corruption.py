"""Corruptions: each does what its name says, and no more."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.pairs.corruption import SampledCloud, crop, jitter, move, rescale, shuffle, unit_sphere


def cloud(n: int = 50, seed: int = 0) -> SampledCloud:
    return np.random.default_rng(seed).normal(size=(n, 3))


def as_set(points: SampledCloud) -> set[tuple[float, ...]]:
    return {tuple(point) for point in points.tolist()}


def test_jitter_is_normal_and_clipped() -> None:
    still = np.zeros((20_000, 3))
    noise = jitter(still, 0.01, 0.05, generator=np.random.default_rng(2))
    assert noise.mean() == pytest.approx(0, abs=2e-4)
    assert noise.std() == pytest.approx(0.01, rel=0.02)
    clipped = jitter(still, 0.01, 0.015, generator=np.random.default_rng(2))
    assert np.abs(clipped).max() == 0.015
    np.testing.assert_array_equal(clipped, np.clip(noise, -0.015, 0.015))


def test_jitter_moves_points_and_leaves_its_input() -> None:
    points = cloud()
    moved = jitter(points, 0.01, 0.05, generator=np.random.default_rng(3))
    np.testing.assert_array_equal(points, cloud())
    assert 0 < np.abs(moved - points).max() <= 0.05


@given(n=st.integers(1, 300), percent=st.integers(1, 100))
def test_a_crop_keeps_the_ceiling_of_its_share(n: int, percent: int) -> None:
    kept = crop(cloud(n), percent / 100, generator=np.random.default_rng(0))
    assert len(kept) == math.ceil(Fraction(percent, 100) * n)


def test_the_share_is_not_rounded_up_by_the_last_binary_digit() -> None:
    kept = crop(cloud(100), 0.55, generator=np.random.default_rng(0))  # 0.55 * 100 > 55 in binary
    assert len(kept) == 55


def test_a_crop_is_a_half_space_and_keeps_the_order() -> None:
    points = cloud(200)
    direction = np.random.default_rng(4).normal(size=3)
    kept = crop(points, 0.7, generator=np.random.default_rng(4))
    expected = points[points @ direction >= np.quantile(points @ direction, 0.3)]
    np.testing.assert_array_equal(kept, expected)


def test_keeping_all_keeps_all() -> None:
    np.testing.assert_array_equal(crop(cloud(), 1.0, generator=np.random.default_rng(0)), cloud())


@pytest.mark.parametrize("keep", [0.0, -0.1, 1.1, math.nan])
def test_refuses_a_share_that_is_none(keep: float) -> None:
    with pytest.raises(ValueError, match=r"crop needs keep in \(0, 1\], got"):
        crop(cloud(), keep, generator=np.random.default_rng(0))


def test_a_shuffle_keeps_the_points_and_forgets_their_order() -> None:
    points = cloud()
    shuffled = shuffle(points, generator=np.random.default_rng(5))
    assert as_set(shuffled) == as_set(points)
    assert not (shuffled == points).all()
    np.testing.assert_array_equal(points, cloud())


def test_every_draw_follows_its_generator() -> None:
    def draws(seed: int) -> list[np.ndarray]:
        g = np.random.default_rng(seed)
        return [
            draw_pose(PoseRange(1.0, 1.0), generator=g),
            jitter(cloud(), 0.1, 0.5, generator=g),
            crop(cloud(), 0.5, generator=g),
            shuffle(cloud(), generator=g),
        ]

    for first, again, other in zip(draws(6), draws(6), draws(7), strict=True):
        np.testing.assert_array_equal(first, again)
        assert not (first == other).all()


def test_the_unit_sphere_is_reached_and_not_left() -> None:
    centre, scale = unit_sphere(5 + 3 * cloud())
    lengths = np.linalg.norm((5 + 3 * cloud() - centre) / scale, axis=1)
    assert lengths.max() == pytest.approx(1)
    np.testing.assert_allclose(centre, (5 + 3 * cloud()).mean(axis=0))


def test_refuses_a_cloud_without_extent() -> None:
    with pytest.raises(ValueError, match="needs a cloud with extent, got 4 equal points"):
        unit_sphere(np.full((4, 3), 2.0))


def test_rescaling_by_the_unit_sphere_puts_the_cloud_into_it() -> None:
    points = 5 + 3 * cloud()
    scaled = rescale(points, *unit_sphere(points))
    np.testing.assert_allclose(scaled.mean(axis=0), 0, atol=1e-12)
    assert np.linalg.norm(scaled, axis=1).max() == pytest.approx(1)


def test_moving_carries_points_as_worked_by_hand() -> None:
    quarter_turn = np.array([[0.0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    moved = move(np.array([[1.0, 0, 0], [0, 1, 5]]), quarter_turn)
    np.testing.assert_allclose(moved, [[1, 3, 3], [0, 2, 8]])


# Normals that the data set gives.


def sphere(n: int = 50) -> SampledCloud:
    """Points on a ball about (1, 2, 3), and their normals, which point away from it."""
    normals = cloud(n) / np.linalg.norm(cloud(n), axis=1, keepdims=True)
    return np.hstack([[1.0, 2.0, 3.0] + 4 * normals, normals])


def test_nothing_that_is_done_to_points_depends_on_normals() -> None:
    oriented = sphere()
    points = np.ascontiguousarray(oriented[:, :3])

    def outcomes(points: SampledCloud) -> list[np.ndarray]:
        g = np.random.default_rng(6)
        pose = draw_pose(PoseRange(1.0, 1.0), generator=g)
        return [
            jitter(points, 0.1, 0.5, generator=g),
            crop(points, 0.5, generator=g),
            shuffle(points, generator=g),
            rescale(points, *unit_sphere(points)),
            move(points, pose),
        ]

    for with_normals, without in zip(outcomes(oriented), outcomes(points), strict=True):
        assert with_normals.shape[1] == 6
        np.testing.assert_allclose(with_normals[:, :3], without, atol=1e-14)


def test_a_crop_and_a_shuffle_keep_normals_beside_their_points() -> None:
    generator = np.random.default_rng(7)
    for kept in (crop(sphere(), 0.6, generator=generator), shuffle(sphere(), generator=generator)):
        np.testing.assert_allclose(kept[:, :3], [1.0, 2.0, 3.0] + 4 * kept[:, 3:])


def test_jitter_and_scale_leave_normals_alone() -> None:
    jittered = jitter(sphere(), 0.1, 0.5, generator=np.random.default_rng(8))
    np.testing.assert_array_equal(jittered[:, 3:], sphere()[:, 3:])
    scaled = rescale(sphere(), np.array([1.0, 2.0, 3.0]), 4.0)
    np.testing.assert_array_equal(scaled[:, 3:], sphere()[:, 3:])
    np.testing.assert_allclose(scaled[:, :3], scaled[:, 3:])  # now the unit ball


def test_moving_turns_normals_and_does_not_shift_them() -> None:
    pose = draw_pose(PoseRange(2.0, 1.0), generator=np.random.default_rng(9))
    moved = move(sphere(), pose)
    centre = pose[:3, :3] @ [1.0, 2.0, 3.0] + pose[:3, 3]
    np.testing.assert_allclose(moved[:, :3], centre + 4 * moved[:, 3:], atol=1e-12)
