"""RANSAC on FPFH features."""

from typing import Any

import pytest
import torch

from pcrdiff.bindings.open3d import open3d
from pcrdiff.bindings.open3d_registration import registration
from pcrdiff.methods.ransac_fpfh import RansacFPFH
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs

METHOD = RansacFPFH(
    max_distance=0.025, feature_radius=0.3, feature_neighbours=128, normal_radius=0.2
)


def test_the_generator_decides_and_neither_open3ds_own_state_nor_its_threads_do() -> None:
    pairs = synthetic_pairs(1, 300, generator=seeded(3))
    source = pairs.source
    target = pairs.target + 0.01 * torch.randn(pairs.target.shape, generator=seeded(4))
    threads = open3d.utility.get_max_threads()
    generator = seeded(0)
    first = METHOD.register(source, target, generator=generator)
    others = [METHOD.register(source, target, generator=generator) for _ in range(5)]
    again = [METHOD.register(source, target, generator=seeded(0)) for _ in range(5)]
    assert all(torch.equal(first, answer) for answer in again)
    assert not all(torch.equal(first, answer) for answer in others)
    assert open3d.utility.get_max_threads() == threads


def test_refuses_clouds_without_three_matches() -> None:
    triangle = synthetic_pairs(1, 3, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^ransac_fpfh needs 3 matches within 0\.025, got "):
        METHOD.register(triangle.source, 9 * triangle.target, generator=seeded(0))


def test_the_settings_are_open3ds_own(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "registration_ransac_based_on_feature_matching"
    given: dict[str, Any] = {}
    call = getattr(registration, name)

    def listen(*clouds: Any, **settings: Any) -> Any:  # noqa: ANN401
        given.update(settings)
        return call(*clouds, **settings)

    monkeypatch.setattr(registration, name, listen)
    pairs = synthetic_pairs(1, 200, generator=seeded(0))
    METHOD.register(pairs.source, pairs.target, generator=seeded(0))
    criteria, default = given["criteria"], registration.RANSACConvergenceCriteria()
    assert criteria.max_iteration == default.max_iteration == 100_000
    assert criteria.confidence == default.confidence == 0.999
    assert given["ransac_n"] == 3
    edges, distance = given["checkers"]
    similarity = registration.CorrespondenceCheckerBasedOnEdgeLength().similarity_threshold
    assert edges.similarity_threshold == similarity == 0.9
    assert distance.distance_threshold == given["max_correspondence_distance"] == 0.025
