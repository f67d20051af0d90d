"""The project's nouns: choosing pairs, and clouds that are refused."""

import pytest
import torch

from pcrdiff.registration import LearnedMethod, check_clouds
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded


def test_chosen_pairs_come_in_the_order_of_the_choice_with_all_that_is_theirs() -> None:
    pairs = made_up_pairs(4, 10, generator=seeded(0))
    chosen = pairs.select(torch.tensor([2, 0, 2]))
    assert len(pairs) == 4
    assert len(chosen) == 3
    assert chosen.item.tolist() == [2, 0, 2]
    for place, k in enumerate([2, 0, 2]):
        assert torch.equal(chosen.source[place], pairs.source[k])
        assert torch.equal(chosen.target[place], pairs.target[k])
        assert torch.equal(chosen.T_target_source[place], pairs.T_target_source[k])


def test_a_group_goes_with_its_pair() -> None:
    pairs = made_up_pairs(3, 10, generator=seeded(0))
    named = type(pairs)(
        pairs.source, pairs.target, pairs.T_target_source, pairs.item, ("a", "b", "c")
    )
    assert named.select(torch.tensor([2, 1])).group == ("c", "b")


def test_good_clouds_pass() -> None:
    clouds = torch.randn(2, 2, 5, 3, generator=seeded(1))
    check_clouds("icp", clouds[0], clouds[1], minimum=5)


@pytest.mark.parametrize("which", ["source", "target"])
@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_refuses_points_that_are_not_finite(which: str, value: float) -> None:
    clouds = {name: torch.randn(2, 5, 3, generator=seeded(2)) for name in ("source", "target")}
    clouds[which][1, 3, 2] = value
    with pytest.raises(ValueError, match=f"icp needs finite points, got a {which} cloud"):
        check_clouds("icp", clouds["source"], clouds["target"])


def test_refuses_one_repeated_cloud_among_good_ones_and_says_how_many_points_differ() -> None:
    source = torch.randn(3, 5, 3, generator=seeded(3))
    target = source.clone()
    target[1, 2:] = target[1, 0]
    with pytest.raises(
        ValueError, match="icp needs at least 3 distinct points, got a target cloud of 2"
    ):
        check_clouds("icp", source, target)


def test_refuses_a_batch_of_nothing() -> None:
    with pytest.raises(ValueError, match="source cloud of 0"):
        check_clouds("icp", torch.zeros(0, 5, 3), torch.zeros(0, 5, 3))


def test_a_learned_method_must_say_how_it_registers_and_what_it_minimises() -> None:
    pairs = made_up_pairs(1, 10, generator=seeded(0))
    with pytest.raises(NotImplementedError):
        LearnedMethod().register(pairs.source, pairs.target, generator=seeded(0))
    with pytest.raises(NotImplementedError):
        LearnedMethod().loss(pairs, generator=seeded(0))
