"""The paper's settings: splits that do not leak, and pairs that are what they claim."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import pytest
import torch

from pcrdiff.clouds.surface import Cloud, DegenerateShape, Mesh
from pcrdiff.datasets.items import RawItem
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.pairs.scenarios import (
    BLOCK,
    Corruption,
    Split,
    choose_shown,
    find_degenerate,
    make_pair,
    make_pairs,
    split_items,
)
from pcrdiff.registration import SPLITS, Pairs
from tests.pcrdiff.synthetic_clouds import joined

PLAIN = Corruption(
    num_points=40,
    sampling="copies",
    poses=PoseRange(0.7, 1.0),
    jitter_deviation=0.0,
    jitter_clip=0.05,
    keep=1.0,
    normals="estimated",
)
OFFICIAL = Split("official", 0.1, 0.0, (), (), "all")


def surface(seed: int, n: int = 60) -> Cloud:
    return 4 + 3 * np.random.default_rng(seed).normal(size=(n, 3))


def make_items(
    groups: Sequence[str], per_group: int, split: Literal["train", "test"] | None = None
) -> list[RawItem]:
    names = [(group, k) for group in groups for k in range(per_group)]
    return [
        RawItem(f"{group}_{k}", group, split, partial(surface, seed))
        for seed, (group, k) in enumerate(names)
    ]


def make(
    items: Sequence[RawItem],
    index: Sequence[int],
    count: int | None,
    corruption: Corruption,
    seed: Sequence[int],
) -> Pairs:
    return joined(make_pairs(items, choose_shown(index, count, seed), corruption, seed))


def official_items() -> list[RawItem]:
    """Five categories in no order, 20 to train and 4 to test of each, interleaved."""
    groups = ("dog", "ant", "eel", "cat", "bee")
    train, test = make_items(groups, 20, "train"), make_items(groups, 4, "test")
    return train[:50] + test + train[50:]


def by_groups(val: Sequence[str], test: Sequence[str]) -> Split:
    return Split("group", 0.0, 0.0, val, test, "all")


def draw(corruption: Corruption, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    made = make_pair(surface(9), corruption, generator=np.random.default_rng(seed))
    source, target, pose = map(torch.from_numpy, made[:3])
    return source, target, pose


def by_position(points: torch.Tensor) -> torch.Tensor:
    """Sorted, so that clouds compare as sets."""
    return points[points[:, 0].argsort()]


def test_the_official_split_keeps_the_official_test_part_and_holds_out_a_tenth() -> None:
    items = official_items()
    chosen = split_items(items, OFFICIAL)
    assert [len(chosen[name]) for name in SPLITS] == [90, 10, 20]
    assert {items[i].split for i in chosen["test"]} == {"test"}
    assert {items[i].split for i in chosen["train"] + chosen["val"]} == {"train"}
    assert {items[i].group for i in chosen["val"]} == {"ant", "bee", "cat", "dog", "eel"}


@pytest.mark.parametrize(
    "split",
    [
        OFFICIAL,
        replace(OFFICIAL, categories="halves"),
        by_groups(["eel"], ["bee", "dog"]),
        Split("item", 0.1, 0.2, (), (), "all"),
        Split("item", 0.1, 0.3, (), (), "all"),
    ],
)
def test_splits_are_disjoint_and_in_the_order_of_the_data_set(split: Split) -> None:
    chosen = split_items(official_items(), split)
    everything = [i for name in SPLITS for i in chosen[name]]
    assert len(set(everything)) == len(everything)
    assert all(chosen[name] == sorted(chosen[name]) for name in SPLITS)
    if split.categories == "all":
        assert len(everything) == len(official_items())


def test_the_first_half_of_the_alphabet_trains_and_the_second_is_tested() -> None:
    items = official_items()
    chosen = split_items(items, replace(OFFICIAL, categories="halves"))
    assert {items[i].group for i in chosen["train"] + chosen["val"]} == {"ant", "bee"}
    assert {items[i].group for i in chosen["test"]} == {"cat", "dog", "eel"}
    assert {items[i].split for i in chosen["test"]} == {"test"}


def test_named_groups_go_where_they_are_sent() -> None:
    items = make_items(("06", "07", "08"), 3)
    chosen = split_items(items, by_groups(["07"], ["08"]))
    assert chosen == {"train": [0, 1, 2], "val": [3, 4, 5], "test": [6, 7, 8]}


def test_groups_stay_whole_where_none_is_named() -> None:
    items = make_items([f"{k:02}" for k in range(10)], 3)
    chosen = split_items(items, Split("group", 0.1, 0.2, (), (), "all"))
    places = [{items[i].group for i in chosen[name]} for name in SPLITS]
    assert [len(groups) for groups in places] == [7, 1, 2]
    assert not places[0] & places[1] | places[0] & places[2] | places[1] & places[2]
    assert sum(len(chosen[name]) for name in SPLITS) == 30


@pytest.mark.parametrize(
    ("val", "test"), [(0.1, 0.1), (0.1, 0.2), (0.2, 0.1), (0.1, 0.3), (0.2, 0.3), (0.15, 0.25)]
)
def test_shares_are_kept_to_the_item_and_spread_evenly(val: float, test: float) -> None:
    chosen = split_items(make_items(("a", "b"), 50), Split("item", val, test, (), (), "all"))
    assert len(chosen["test"]) == round(100 * test)
    assert len(chosen["val"]) == round(100 * val)
    assert np.diff(chosen["test"]).max() <= np.ceil(1 / test)


def test_refuses_a_group_that_does_not_exist() -> None:
    items = make_items(("06", "07"), 2)
    for split in (by_groups(["9"], ["07"]), by_groups(["06"], ["9"])):
        with pytest.raises(
            ValueError, match=r"needs the group '9', the data set has \['06', '07'\]"
        ):
            split_items(items, split)


@pytest.mark.parametrize(
    ("split", "missing"),
    [
        (by_groups(["a"], ["b"]), "train"),
        (by_groups([], ["b"]), "val"),
        (by_groups(["a"], []), "test"),
        (Split("item", 0.0, 0.5, (), (), "all"), "val"),
        (Split("official", 0.1, 0.0, (), (), "all"), "train"),
    ],
)
def test_refuses_a_part_without_items(split: Split, missing: str) -> None:
    with pytest.raises(ValueError, match=f"needs items in each part, got none for {missing}"):
        split_items(make_items(("a", "b"), 2), split)


def test_the_target_of_copies_is_the_moved_source_in_another_order() -> None:
    source, target, pose = draw(PLAIN)
    moved = transform(pose, source)
    assert not torch.allclose(moved, target)
    torch.testing.assert_close(by_position(target), by_position(moved))


def test_the_source_stays_upright_in_the_unit_sphere() -> None:
    source, _, _ = draw(PLAIN)
    assert source.norm(dim=-1).max().item() == pytest.approx(1)
    torch.testing.assert_close(source.mean(dim=0), torch.zeros(3, dtype=torch.float64))
    raw = torch.from_numpy(surface(9))
    distances = torch.cdist(raw, raw)
    ratio = torch.cdist(source, source).max() / distances.max()
    assert torch.isclose(distances * ratio, torch.cdist(source, source).max()).any()


def test_independent_samples_share_the_surface_but_not_the_points() -> None:
    mesh = Mesh(vertices=np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]]), faces=np.array([[0, 1, 2]]))
    corruption = replace(PLAIN, sampling="independent")
    made = make_pair(mesh, corruption, generator=np.random.default_rng(0))
    source, target, pose = map(torch.from_numpy, made[:3])
    back = transform(invert(pose), target)
    assert torch.cdist(source, back).min(dim=1).values.median() > 1e-3
    torch.testing.assert_close(back[:, 2], torch.zeros(40, dtype=torch.float64))  # the same plane


@pytest.mark.parametrize("sampling", ["copies", "independent"])
def test_a_crop_keeps_the_ceiling_of_seventy_percent_of_each_cloud_by_itself(
    sampling: Literal["copies", "independent"],
) -> None:
    corruption = replace(PLAIN, num_points=33, keep=0.7, sampling=sampling)
    source, target, pose = draw(corruption)
    assert source.shape == target.shape == (24, 3)  # 23.1
    back = transform(invert(pose), target)
    shared = (torch.cdist(source, back).min(dim=1).values < 1e-9).sum()
    assert shared < 24  # two directions, two crops


def test_jitter_is_laid_on_each_cloud_by_itself_after_the_move() -> None:
    noisy = replace(PLAIN, jitter_deviation=0.01)
    source, target, pose = draw(noisy)
    gaps = torch.cdist(transform(pose, source), target).min(dim=1).values
    assert 1e-3 < gaps.median() < 0.05
    clean, _, clean_pose = draw(PLAIN)
    assert torch.equal(pose, clean_pose)
    assert 0 < (source - clean).abs().max() <= 0.05


def test_the_pose_stays_in_its_range() -> None:
    for seed in range(20):
        _, _, pose = draw(replace(PLAIN, poses=PoseRange(0.1, 0.2)), seed)
        assert (pose[:3, 3] >= 0).all()
        assert (pose[:3, 3] <= 0.2).all()
        assert torch.arccos(((pose[:3, :3].trace() - 1) / 2).clamp(-1, 1)) <= 0.1 * 3**0.5 + 0.01


def test_one_pair_of_each_item_in_order_or_as_many_as_asked_in_another() -> None:
    items = make_items(("a", "b"), 3)
    each = make(items, [4, 1, 2], None, PLAIN, [7])
    assert each.item.tolist() == [4, 1, 2]
    assert each.group == ("b", "a", "a")
    many = make(items, [4, 1, 2], 7, PLAIN, [7])
    assert sorted(many.item.tolist()[:3]) == [1, 2, 4]
    assert many.item[3:].tolist() == [*many.item[:3].tolist(), many.item[0].item()]


def test_a_pair_does_not_depend_on_how_many_are_made() -> None:
    items = make_items(("a", "b"), 3)
    few, many = (make(items, range(6), count, PLAIN, [7, 1]) for count in (3, 12))
    assert torch.equal(many.source[:3], few.source)
    assert torch.equal(many.target[:3], few.target)
    assert torch.equal(many.T_target_source[:3], few.T_target_source)
    assert not torch.equal(many.T_target_source[6], many.T_target_source[0])  # the item again


def test_the_same_seed_makes_the_same_bytes_and_another_seed_others() -> None:
    items = make_items(("a", "b"), 3)
    corruption = replace(PLAIN, sampling="independent", jitter_deviation=0.01, keep=0.7)
    first, again, other = (make(items, range(6), None, corruption, s) for s in ([7], [7], [8]))
    for name in ("source", "target", "T_target_source"):
        assert getattr(first, name).numpy().tobytes() == getattr(again, name).numpy().tobytes()
        assert not torch.equal(getattr(first, name), getattr(other, name))


def test_pairs_keep_their_pose_in_double_and_their_points_in_single_precision() -> None:
    pairs = make(make_items(("a",), 2), range(2), None, PLAIN, [0])
    assert pairs.source.dtype == pairs.target.dtype == torch.float32
    assert pairs.T_target_source.dtype == torch.float64


def test_refuses_an_item_that_is_too_small_or_unreadable_by_its_name() -> None:
    def unreadable() -> Cloud:
        raise ValueError("chair_7.off needs faces")

    small = RawItem("chair_6", "chair", None, partial(surface, 0, 39))
    with pytest.raises(ValueError, match="no pair of chair_6: sample_points needs 40 points"):
        make([small], [0], None, PLAIN, [0])
    broken = RawItem("chair_7", "chair", None, unreadable)
    with pytest.raises(ValueError, match=r"no pair of chair_7: chair_7\.off needs faces"):
        make([broken], [0], None, PLAIN, [0])
    flat = RawItem("chair_8", "chair", None, lambda: np.ones((50, 3)))
    with pytest.raises(ValueError, match=r"no pair of chair_8: .* needs a cloud with extent"):
        make([flat], [0], None, PLAIN, [0])


ALONG = np.linspace(-1, 1, 60)[:, None]
DEGENERATE: dict[str, Cloud | Mesh] = {
    "line": ALONG * [[0.3, -0.2, 0.1]] + 5,
    "line in float32": (ALONG * [[0.3, -0.2, 0.1]] + 5).astype(np.float32).astype(np.float64),
    "two points": np.eye(3)[[0, 1] * 30],
    "equal points": np.ones((60, 3)),
    "two heaps": np.eye(3)[[0, 1] * 30] + 1e-9 * np.random.default_rng(0).normal(size=(60, 3)),
    "flat faces": Mesh(np.arange(9.0).reshape(3, 3), np.array([[0, 1, 2]])),
    "slivers": Mesh(
        np.linspace(0, 1, 6)[:, None] * [[0.1, 0.2, 0.3]], np.array([[0, 1, 2], [3, 4, 5]])
    ),
}


@pytest.mark.parametrize("shape", DEGENERATE)
@pytest.mark.parametrize("corruption", [PLAIN, replace(PLAIN, jitter_deviation=0.01, keep=0.7)])
def test_a_degenerate_shape_is_refused_by_its_name_and_found_by_its_number(
    shape: str, corruption: Corruption
) -> None:
    item = RawItem("chair_9", "chair", None, lambda: DEGENERATE[shape])
    items = [*make_items(("a",), 20), item]
    shown = [*range(18), 20, 18, 20]
    with pytest.raises(DegenerateShape, match=r"^no pair of chair_9: .* needs a "):
        make(items, shown, None, corruption, [7])
    assert find_degenerate(items, shown, corruption, [7]) == [18, 20]


def test_a_crop_that_leaves_a_line_is_found_too() -> None:
    handle = np.hstack([np.linspace(1, 9, 50)[:, None], np.zeros((50, 2))])
    broom = RawItem("broom", "tool", None, lambda: np.vstack([handle, 0.01 * surface(0, 10)]))
    shown = [0] * 40
    corruption = replace(PLAIN, num_points=60, keep=0.5)
    found = find_degenerate([broom], shown, corruption, [7])
    assert 0 < len(found) < 40
    rest = {k: 0 for k in range(40) if k not in found}
    assert len(joined(make_pairs([broom], rest, corruption, [7]))) == len(rest)


def test_pairs_that_are_left_out_change_no_other() -> None:
    items = make_items(("a", "b"), 20)
    every = make(items, range(40), None, PLAIN, [7])
    kept = [k for k in range(40) if k not in (0, 17, 18)]
    some = joined(make_pairs(items, {k: k for k in kept}, PLAIN, [7]))
    for name in ("source", "target", "T_target_source", "item"):
        assert torch.equal(getattr(some, name), getattr(every, name)[kept])
    assert some.group == tuple(every.group[k] for k in kept)


@pytest.mark.parametrize(
    "shape", [surface(0) * [[1, 1, 0]], surface(0) * [[1, 1e-3, 0]], np.eye(3)[[0, 1, 2] * 20]]
)
def test_flat_and_narrow_shapes_are_none(shape: Cloud) -> None:
    item = RawItem("plate", "plate", None, lambda: shape)
    assert len(make([item], [0], None, PLAIN, [7])) == 1
    assert find_degenerate([item], [0], PLAIN, [7]) == []


def test_a_shape_that_cannot_be_read_is_no_degenerate_one() -> None:
    small = RawItem("chair_6", "chair", None, partial(surface, 0, 39))
    with pytest.raises(ValueError, match="no pair of chair_6: sample_points needs 40 points"):
        find_degenerate([small], [0], PLAIN, [0])


def ball(seed: int) -> Cloud:
    """Points on a ball with their normals: the outward directions."""
    normals = np.random.default_rng(seed).normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.hstack([7 + 2 * normals, normals])


def make_balls(corruption: Corruption) -> Pairs:
    items = [RawItem(f"ball_{seed}", "ball", None, partial(ball, seed)) for seed in range(4)]
    return make(items, range(4), None, corruption, [7])


HARD = replace(PLAIN, sampling="independent", jitter_deviation=0.01, keep=0.7)


def test_given_normals_are_those_of_the_clean_surface_in_each_clouds_own_frame() -> None:
    pairs = make_balls(replace(HARD, jitter_deviation=0.0, normals="given"))
    assert pairs.source_normals is not None
    assert pairs.target_normals is not None
    pose = pairs.T_target_source
    back = transform(invert(pose), pairs.target.double())
    back_normals = pairs.target_normals.double() @ pose[:, :3, :3]
    for points, normals in (
        (pairs.source.double(), pairs.source_normals.double()),
        (back, back_normals),
    ):
        differences = points[:, 1:] - points[:, :1]  # the radius is not known, but it is one
        radius = differences.norm(dim=-1) / (normals[:, 1:] - normals[:, :1]).norm(dim=-1)
        torch.testing.assert_close(
            differences,
            radius.mean(dim=1)[:, None, None] * (normals[:, 1:] - normals[:, :1]),
            atol=1e-5,
            rtol=0,
        )
        torch.testing.assert_close(normals.norm(dim=-1), torch.ones(4, 28).double())


@pytest.mark.parametrize("corruption", [PLAIN, HARD])
def test_giving_normals_changes_no_point_and_no_pose(corruption: Corruption) -> None:
    with_normals = make_balls(replace(corruption, normals="given"))
    without = make_balls(corruption)
    assert without.source_normals is without.target_normals is None
    assert torch.equal(with_normals.T_target_source, without.T_target_source)
    for name in ("source", "target"):
        torch.testing.assert_close(
            getattr(with_normals, name), getattr(without, name), atol=1e-7, rtol=0
        )


def test_given_normals_are_not_jittered() -> None:
    noisy = make_balls(replace(PLAIN, jitter_deviation=0.01, normals="given"))
    clean = make_balls(replace(PLAIN, normals="given"))
    assert noisy.source_normals is not None
    assert clean.source_normals is not None
    assert torch.equal(noisy.source_normals, clean.source_normals)
    assert not torch.equal(noisy.source, clean.source)


def test_refuses_to_give_normals_of_an_item_that_has_none_by_its_name() -> None:
    items = make_items(("06",), 1)
    with pytest.raises(ValueError, match=r"no pair of 06_0: .* needs a cloud with normals"):
        make(items, [0], None, replace(PLAIN, normals="given"), [0])


def test_pairs_come_in_blocks_and_none_is_made_before_it_is_asked_for() -> None:
    read: list[int] = []

    def watched(seed: int) -> Cloud:
        read.append(seed)
        return surface(seed)

    items = [RawItem(f"{k}", "a", None, partial(watched, k)) for k in range(2 * BLOCK + 1)]
    blocks = make_pairs(items, range(len(items)), PLAIN, [7])
    assert read == []
    assert len(next(blocks)) == BLOCK
    assert read == list(range(BLOCK))
    assert [len(block) for block in blocks] == [BLOCK, 1]


NOISY = replace(PLAIN, sampling="independent", jitter_deviation=0.01, keep=0.7)


def test_the_whole_shape_lies_where_the_source_does_and_changes_no_other_draw() -> None:
    items = make_items(["a"], 2)
    plain = make(items, [0, 1], None, NOISY, [3])
    kept = make(items, [0, 1], None, replace(NOISY, shape_points=60), [3])
    for name in ("source", "target", "T_target_source"):
        assert torch.equal(getattr(plain, name), getattr(kept, name))
    assert plain.shape is None
    assert kept.shape is not None
    assert kept.shape.shape == (2, 60, 3)
    off = torch.cdist(kept.source, kept.shape).amin(dim=2)
    assert (off < 0.09).all()  # the noise, clipped at 0.05 along each axis
    assert len(np.unique(kept.shape[0].numpy(), axis=0)) == 60


def test_a_cloud_of_fewer_points_is_its_whole_shape() -> None:
    kept = make(make_items(["a"], 1), [0], None, replace(NOISY, shape_points=100), [3])
    assert kept.shape is not None
    assert kept.shape.shape[1] == 100
    assert len(np.unique(kept.shape[0].numpy(), axis=0)) == 60


def test_exact_copies_need_no_shape() -> None:
    kept = make(make_items(["a"], 1), [0], None, replace(PLAIN, shape_points=60), [3])
    assert kept.shape is None
