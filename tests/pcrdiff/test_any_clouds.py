"""``pcrdiff.register`` on any two clouds: the pose in their own unit and frame, and its verdict."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import pcrdiff
from pcrdiff.any_clouds import EVIDENCE, LADDER, Prepared, verdicts
from pcrdiff.clouds.surface import sample_points
from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pipeline.synthetic.modelnet40 import make_shape

CHAIR = sample_points(
    make_shape("chair", generator=np.random.default_rng(3)),
    3000,
    generator=np.random.default_rng(4),
)
CHAIR /= np.linalg.norm(CHAIR - CHAIR.mean(axis=0), axis=1).max()


def crops(seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two crops of a chair with jitter, each of other points, and the pose between them."""
    generator = np.random.default_rng(seed)
    T = draw_pose(PoseRange(None, 0.5, -0.5), generator=generator)
    order = generator.permutation(len(CHAIR))
    source, target = CHAIR[order[:1500]], CHAIR[order[1500:]]
    source, target = (
        each[np.argsort(each @ generator.normal(size=3))[: int(0.8 * len(each))]]
        + generator.normal(scale=0.005, size=(int(0.8 * len(each)), 3))
        for each in (source, target)
    )
    return source, target @ T[:3, :3].T + T[:3, 3], T


def off(T: np.ndarray, truth: np.ndarray, points: np.ndarray) -> float:
    """How far a pose lays the points from where they belong, at most."""
    moved = points @ (T - truth)[:3, :3].T + (T - truth)[:3, 3]
    return float(np.linalg.norm(moved, axis=1).max())


def test_two_crops_under_any_rotation_are_registered_and_trusted() -> None:
    source, target, T = crops()
    found = pcrdiff.register(source, target)
    assert found.verdict == "trust"
    assert off(found.T_target_source, T, source) < 0.05
    assert found.probability > 0.9
    assert 0.5 < found.overlap <= 1
    assert 0 < found.rmse < 0.1
    assert found.method == "features"
    assert found.seconds > 0


@pytest.mark.parametrize(("unit", "shift"), [(1000.0, 0.0), (1.0, 5e6), (1e-3, 0.0)])
def test_the_unit_and_frame_are_the_callers(unit: float, shift: float) -> None:
    source, target, T = crops()
    away = np.array([shift, -shift, 0])
    found = pcrdiff.register(unit * source + away, unit * target + away)
    scaled = T.copy()
    scaled[:3, 3] = unit * T[:3, 3] + away - T[:3, :3] @ away
    assert off(found.T_target_source, scaled, unit * source + away) < 0.05 * unit
    assert found.verdict == "trust"
    assert found.rmse == pytest.approx(unit * pcrdiff.register(source, target).rmse, rel=0.2)


def test_the_same_seed_gives_the_same_answer_and_inputs_stay_as_they_are() -> None:
    source, target, _ = crops()
    before = source.copy(), target.copy()
    one, other = (pcrdiff.register(source, target, method="random", seed=3) for _ in range(2))
    np.testing.assert_array_equal(one.T_target_source, other.T_target_source)
    values = [
        vars(replace(found, seconds=0.0, T_target_source=np.eye(4))) for found in (one, other)
    ]
    assert str(values[0]) == str(values[1])
    np.testing.assert_array_equal(before, (source, target))


def test_clouds_of_different_things_are_doubted() -> None:
    source, _, _ = crops()
    plant = make_shape("airplane", generator=np.random.default_rng(3))
    other = sample_points(plant, 1200, generator=np.random.default_rng(5))
    found = pcrdiff.register(source, other)
    assert found.verdict == "doubt"
    assert found.method == "features + random + diffusion", "auto tries everything first"


@pytest.mark.parametrize("method", ["features", "random", "diffusion"])
def test_each_source_of_starts_can_be_asked_for_alone(method: str) -> None:
    source, target, _ = crops()
    found = pcrdiff.register(source, target, method=method)  # type: ignore[arg-type]
    assert found.method == method
    R = found.T_target_source[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)


def test_tensors_wide_arrays_and_files_are_clouds(tmp_path: Path) -> None:
    source, target, _ = crops()
    given = pcrdiff.register(source, target)
    np.save(tmp_path / "a.npy", source)
    wide = np.hstack([target, np.ones((len(target), 2))])
    found = pcrdiff.register(tmp_path / "a.npy", torch.from_numpy(wide).requires_grad_())
    np.testing.assert_array_equal(found.T_target_source, given.T_target_source)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        (np.zeros((0, 3)), "the source cloud needs points"),
        (np.zeros((5, 2)), r"the source cloud needs numbers as \[n, 3\]"),
        (np.array([["a", "b", "c"]]), "the source cloud needs numbers"),
        (np.full((5, 3), np.nan), "the source cloud needs finite coordinates"),
        (np.ones((50, 3)), "distinct points, the source cloud has 1"),
        (np.arange(6.0).reshape(2, 3), "distinct points, the source cloud has 2"),
    ],
)
def test_what_is_no_cloud_is_refused(source: np.ndarray, message: str) -> None:
    _, target, _ = crops()
    with pytest.raises(ValueError, match=message):
        pcrdiff.register(source, target)


def test_where_no_feature_matches_the_other_starts_are_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pcrdiff.any_clouds.LEAST_MATCHES", 10**6)
    source, target, T = crops()
    found = pcrdiff.register(source, target)
    assert found.method == "features + random + diffusion"
    assert off(found.T_target_source, T, source) < 0.1
    with pytest.raises(ValueError, match="needs features that match"):
        pcrdiff.register(source, target, method="features")


def test_a_cloud_far_smaller_than_the_other_is_refused() -> None:
    source, target, _ = crops()
    with pytest.raises(ValueError, match=r"the target cloud has .* far smaller than the other"):
        pcrdiff.register(source, target / 1000)


def test_large_clouds_are_thinned_to_what_their_voxels_hold() -> None:
    dense = np.repeat(CHAIR, 40, axis=0) + np.random.default_rng(0).normal(
        scale=0.002, size=(40 * len(CHAIR), 3)
    )
    clouds = Prepared(dense, CHAIR)
    assert len(clouds.source) <= 4000
    assert clouds.voxel > 0.02


def test_verdicts_weigh_the_evidence_there_is_for_every_set_of_sources() -> None:
    sets = {" + ".join(rung) for rungs in LADDER.values() for rung in rungs}
    assert verdicts().keys() == sets
    for verdict in verdicts().values():
        assert len(verdict.coefficients) == len(EVIDENCE)
        assert verdict.pairs >= 50
