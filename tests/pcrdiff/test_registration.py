"""The project's nouns: choosing pairs, what a method is shown of them, clouds that are refused."""

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from pcrdiff.registration import LearnedMethod, Pairs, check_clouds
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def test_chosen_pairs_come_in_the_order_of_the_choice_with_all_that_is_theirs() -> None:
    pairs = synthetic_pairs(4, 10, generator=seeded(0))
    chosen = pairs.select(torch.tensor([2, 0, 2]))
    assert len(pairs) == 4
    assert len(chosen) == 3
    assert chosen.item.tolist() == [2, 0, 2]
    for place, k in enumerate([2, 0, 2]):
        assert torch.equal(chosen.source[place], pairs.source[k])
        assert torch.equal(chosen.target[place], pairs.target[k])
        assert torch.equal(chosen.T_target_source[place], pairs.T_target_source[k])


def test_a_group_goes_with_its_pair() -> None:
    pairs = synthetic_pairs(3, 10, generator=seeded(0))
    named = type(pairs)(
        pairs.source, pairs.target, pairs.T_target_source, pairs.item, ("a", "b", "c")
    )
    assert named.select(torch.tensor([2, 1])).group == ("c", "b")


def pairs_with_normals() -> Pairs:
    source, target = torch.nn.functional.normalize(
        torch.randn(2, 4, 10, 3, generator=seeded(9)), dim=-1
    )
    pairs = synthetic_pairs(4, 10, generator=seeded(0))
    return replace(pairs, source_normals=source, target_normals=target)


def test_normals_go_with_their_pair_where_there_are_any() -> None:
    pairs, index = pairs_with_normals(), torch.tensor([2, 0, 2])
    chosen = pairs.select(index)
    assert pairs.source_normals is not None
    assert pairs.target_normals is not None
    assert chosen.source_normals is not None
    assert chosen.target_normals is not None
    assert torch.equal(chosen.source_normals, pairs.source_normals[index])
    assert torch.equal(chosen.target_normals, pairs.target_normals[index])
    without = synthetic_pairs(4, 10, generator=seeded(0)).select(index)
    assert without.source_normals is without.target_normals is None


def test_clouds_to_estimate_normals_of_are_points_alone() -> None:
    for pairs in (pairs_with_normals(), synthetic_pairs(4, 10, generator=seeded(0))):
        source, target = pairs.clouds("estimated")
        assert torch.equal(source, pairs.source)
        assert torch.equal(target, pairs.target)


def test_clouds_with_given_normals_are_points_and_then_normals() -> None:
    pairs = pairs_with_normals()
    assert pairs.source_normals is not None
    assert pairs.target_normals is not None
    source, target = pairs.clouds("given")
    assert source.shape == target.shape == (4, 10, 6)
    assert torch.equal(source[..., :3], pairs.source)
    assert torch.equal(source[..., 3:], pairs.source_normals)
    assert torch.equal(target[..., :3], pairs.target)
    assert torch.equal(target[..., 3:], pairs.target_normals)


def test_refuses_to_give_normals_that_there_are_none_of() -> None:
    whole = pairs_with_normals()
    for pairs in (
        replace(whole, source_normals=None, target_normals=None),
        replace(whole, source_normals=None),
        replace(whole, target_normals=None),
    ):
        with pytest.raises(ValueError, match=r"the pairs hold no normals, .* `normals: given`"):
            pairs.clouds("given")


def test_good_clouds_pass() -> None:
    clouds = torch.randn(2, 2, 5, 3, generator=seeded(1))
    check_clouds("icp", clouds[0], clouds[1], minimum=5)
    oriented = torch.cat([clouds, clouds.flip(-1)], dim=-1)
    check_clouds("rpmnet", oriented[0], oriented[1], minimum=5)


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


def test_normals_make_no_points_distinct_and_have_to_be_finite() -> None:
    normals = torch.eye(3).repeat(1, 2, 1)
    good = torch.cat([torch.randn(1, 6, 3, generator=seeded(4)), normals], dim=-1)
    one_place = torch.cat([torch.ones(1, 6, 3), normals], dim=-1)
    with pytest.raises(ValueError, match=r"needs at least 3 distinct points, got a source .* of 1"):
        check_clouds("rpmnet", one_place, good)
    broken = good.clone()
    broken[0, 2, 4] = torch.nan
    with pytest.raises(ValueError, match="needs finite points, got a target cloud"):
        check_clouds("rpmnet", good, broken)


@pytest.mark.parametrize("channels", [2, 4, 7])
def test_refuses_clouds_that_are_neither_points_nor_points_with_normals(channels: int) -> None:
    clouds = torch.randn(2, 1, 5, channels, generator=seeded(5))
    with pytest.raises(ValueError, match=f"needs 3 or 6 channels, got a source .* of {channels}"):
        check_clouds("icp", clouds[0], clouds[1])


def test_refuses_a_batch_of_nothing() -> None:
    with pytest.raises(ValueError, match="source cloud of 0"):
        check_clouds("icp", torch.zeros(0, 5, 3), torch.zeros(0, 5, 3))


def test_a_learned_method_must_say_how_it_registers_and_what_it_minimises() -> None:
    class Halfway(LearnedMethod):
        """Minimises nothing."""

        def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
            raise ValueError(source, target, generator)

    for incomplete in (LearnedMethod, Halfway):
        with pytest.raises(TypeError, match="abstract"):
            incomplete()  # type: ignore[abstract]
