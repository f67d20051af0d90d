"""KISS-Matcher in a child process."""

from typing import Any

import kiss_matcher
import numpy as np
import pytest
import torch

from pcrdiff.bindings.kiss_matcher import kiss_match
from pcrdiff.evaluation import evaluate
from pcrdiff.methods.kiss_matcher import KISSMatcher
from pcrdiff.registration import Pairs
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs

METHOD = KISSMatcher(voxel_size=0.05, timeout=60.0)


def test_answers_alike_each_time_also_from_new_children() -> None:
    pairs = synthetic_pairs(2, 512, generator=seeded(3))
    noisy = pairs.target + 0.01 * torch.randn(pairs.target.shape, generator=seeded(4))
    answers = [
        method.register(pairs.source, noisy, generator=seeded(k))
        for k, method in enumerate([METHOD, METHOD, KISSMatcher(0.05, 60.0)])
    ]
    assert all(torch.equal(answer, answers[0]) for answer in answers)


def test_a_pair_that_ends_the_process_fails_alone() -> None:
    good = synthetic_pairs(2, 512, generator=seeded(5))
    sparse = good.source.clone()
    sparse[1] *= 100  # no point has a neighbour, so none a feature: the library dies of it
    answers = evaluate(
        METHOD,
        Pairs(
            sparse[[0, 1, 0]],
            good.target[[0, 1, 0]],
            good.T_target_source[[0, 1, 0]],
            good.item[[0, 1, 0]],
            ("potato",) * 3,
        ),
        seed=0,
    )
    assert answers.failures[1].startswith("kiss_matcher's native code ended its process (signal ")
    assert answers.failures[0] == answers.failures[2] == ""
    assert torch.equal(answers.T_target_source[0], answers.T_target_source[2])


def test_refuses_clouds_without_three_matches_that_agree() -> None:
    pairs = synthetic_pairs(1, 512, generator=seeded(6))
    other = torch.rand(1, 512, 3, generator=seeded(7))
    with pytest.raises(ValueError, match=r"^kiss_matcher needs 3 matches that agree, got [012]$"):
        KISSMatcher(0.03, 60.0).register(pairs.source, other, generator=seeded(0))


def test_the_settings_are_the_librarys_own_but_for_the_voxels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given, make = [], kiss_matcher.KISSMatcher

    def listen(config: Any) -> Any:  # noqa: ANN401
        given.append(config)
        return make(config)

    monkeypatch.setattr(kiss_matcher, "KISSMatcher", listen)
    pairs = synthetic_pairs(1, 512, generator=seeded(0))
    kiss_match(pairs.source[0].numpy(), pairs.target[0].numpy(), 0.05)
    default = kiss_matcher.KISSMatcherConfig(voxel_size=0.05)
    names = {name for name in dir(default) if not name.startswith("_")} - {"use_voxel_sampling"}
    assert "robin_noise_bound" in names
    assert {n: getattr(given[0], n) for n in names} == {n: getattr(default, n) for n in names}
    assert (given[0].use_voxel_sampling, default.use_voxel_sampling) == (False, True)
    lengths = [default.normal_radius, default.fpfh_radius, default.robin_noise_bound]
    assert np.allclose(lengths, [0.15, 0.25, 0.05])
