"""Fast Global Registration."""

from typing import Any

import pytest
import torch

from pcrdiff.classical import registration
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded
from tests.pcrdiff.methods.made_up_methods import make_fgr


def test_the_generator_decides_and_open3ds_own_state_does_not() -> None:
    pairs = made_up_pairs(1, 200, generator=seeded(3))
    method, generator = make_fgr(), seeded(0)
    first = method.register(pairs.source, pairs.target, generator=generator)
    method.register(pairs.source, pairs.target, generator=generator)
    again = method.register(pairs.source, pairs.target, generator=seeded(0))
    assert torch.equal(first, again)


def test_refuses_clouds_without_three_matches() -> None:
    triangle = made_up_pairs(1, 3, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^fgr "):
        make_fgr().register(triangle.source, triangle.target, generator=seeded(0))


def test_open3ds_documented_settings_but_for_the_three_that_are_lengths_and_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = []
    fit = registration.registration_fgr_based_on_feature_matching

    def spy(*arguments: Any) -> Any:  # noqa: ANN401  Open3D's
        given.append(arguments[-1])
        return fit(*arguments)

    monkeypatch.setattr(registration, "registration_fgr_based_on_feature_matching", spy)
    pairs = made_up_pairs(1, 200, generator=seeded(5))
    make_fgr().register(pairs.source, pairs.target, generator=seeded(0))
    (option,) = given
    assert (option.division_factor, option.decrease_mu) == (1.4, False)
    assert (option.tuple_test, option.tuple_scale, option.maximum_tuple_count) == (True, 0.95, 1000)
    assert (option.use_absolute_scale, option.maximum_correspondence_distance) == (True, 0.01)
    assert option.iteration_number == 64
