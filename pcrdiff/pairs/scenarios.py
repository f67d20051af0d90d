"""The paper's settings: which items make which split, and how an item becomes a pair."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float64

from pcrdiff.clouds.surface import DegenerateShape, Mesh, sample_oriented, sample_points
from pcrdiff.datasets.items import RawItem
from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.geometry.span import spans_plane
from pcrdiff.loops import Progress, Spread, in_turn, silent
from pcrdiff.pairs.corruption import SampledCloud, crop, jitter, move, rescale, shuffle, unit_sphere
from pcrdiff.registration import SPLITS, Normals, Pairs

Shown = Sequence[int] | Mapping[int, int]
"""Which item each pair shows; by the pairs' own numbers where some are left out."""
BLOCK = 16
"""Pairs that are made, handed over and written together."""
MadePair = tuple[
    SampledCloud,
    SampledCloud,
    Float64[np.ndarray, "4 4"],
    Float64[np.ndarray, "kept 3"] | None,
]
"""Source, target, T_target_source, and the whole shape where it is kept."""


@dataclass(frozen=True)
class Split:
    """Which items train, which choose the weights, which are tested on.

    ``official`` keeps the data set's own test part and holds every n-th training item out for
    validation; ``group`` keeps scenes or sequences whole, those named or, where none is named,
    every n-th; ``item`` takes every n-th item.
    """

    by: Literal["official", "group", "item"]
    val_fraction: float
    test_fraction: float
    val_groups: Sequence[str]
    test_groups: Sequence[str]
    categories: Literal["all", "halves"]
    """``halves``: the alphabetical first half of the categories trains, the second is tested."""


@dataclass(frozen=True)
class Corruption:
    """How an item becomes a pair; lengths after scaling to the unit sphere."""

    num_points: int
    sampling: Literal["copies", "independent"]
    """Both clouds are the same points in another order, or two samples of the surface."""
    poses: PoseRange
    jitter_deviation: float
    jitter_clip: float
    keep: float
    """Share of each cloud that its own half-space crop leaves; 1 leaves all."""
    normals: Normals
    """``given`` keeps the data set's own, those of the clean surface; ``estimated`` none."""
    shape_points: int = 0
    """Points of the whole shape, kept beside the pair to measure answers by; 0 keeps none."""


def split_items(items: Sequence[RawItem], split: Split) -> dict[str, list[int]]:
    """Index of the items of each split, in the data set's order.

    Raises:
        ValueError: A split is left without items, or a named group does not exist.
    """
    if split.by == "group":
        chosen = _by_group(items, split)
    elif split.by == "item":
        chosen = _by_share(range(len(items)), split.val_fraction, split.test_fraction)
    else:
        trained = [i for i, item in enumerate(items) if item.split == "train"]
        chosen = _by_share(trained, split.val_fraction, 0.0)
        chosen["test"] = [i for i, item in enumerate(items) if item.split == "test"]
    if split.categories == "halves":
        chosen = _by_halves(items, chosen)
    for name in SPLITS:
        if not chosen[name]:
            raise ValueError(f"split by {split.by} needs items in each part, got none for {name}")
    return chosen


def _by_share(
    candidates: Sequence[int], val_fraction: float, test_fraction: float
) -> dict[str, list[int]]:
    """Spread test evenly over the candidates, and val over those that are left."""
    rest, test = _spread(candidates, test_fraction)
    train, val = _spread(rest, val_fraction * len(candidates) / max(len(rest), 1))
    return {"train": train, "val": val, "test": test}


def _spread(candidates: Sequence[int], share: float) -> tuple[list[int], list[int]]:
    """Those that are left, and the chosen: the k-th is chosen where ``k * share`` crosses one."""
    left: list[int] = []
    chosen: list[int] = []
    for k, index in enumerate(candidates):
        crosses = int((k + 1) * share + 1e-9) > int(k * share + 1e-9)
        (chosen if crosses else left).append(index)
    return left, chosen


def _by_group(items: Sequence[RawItem], split: Split) -> dict[str, list[int]]:
    groups = sorted({item.group for item in items})
    for name in (*split.val_groups, *split.test_groups):
        if name not in groups:
            raise ValueError(f"split needs the group {name!r}, the data set has {groups}")
    if split.val_groups or split.test_groups:
        place = dict.fromkeys(groups, "train")
        place |= dict.fromkeys(split.val_groups, "val") | dict.fromkeys(split.test_groups, "test")
    else:
        shares = _by_share(range(len(groups)), split.val_fraction, split.test_fraction)
        place = {groups[k]: name for name, chosen in shares.items() for k in chosen}
    return {
        name: [i for i, item in enumerate(items) if place[item.group] == name] for name in SPLITS
    }


def _by_halves(items: Sequence[RawItem], chosen: Mapping[str, list[int]]) -> dict[str, list[int]]:
    categories = sorted({item.group for item in items})
    first = set(categories[: len(categories) // 2])
    return {
        name: [i for i in index if (items[i].group in first) == (name != "test")]
        for name, index in chosen.items()
    }


def make_pair(
    surface: Mesh | Float64[np.ndarray, "surface columns"],
    corruption: Corruption,
    *,
    generator: np.random.Generator,
) -> MadePair:
    """Source, target and the T_target_source that carries the one into the other's frame.

    The source stays in the item's own frame, scaled to the unit sphere; the target is moved
    (Eq. 3: Q = G P). Given normals are three more channels of both. The shape is the whole item in
    the source's frame, without noise; it is drawn last, and None where none is kept or the clouds
    are made of its points.

    Raises:
        ValueError: The item has too few points, or lacks normals that are to be given.
        DegenerateShape: The points of a cloud are on one line or in one place.
    """
    sample = sample_oriented if corruption.normals == "given" else sample_points
    drawn = sample(surface, corruption.num_points, generator=generator)
    _check_extent(drawn)
    centre, scale = unit_sphere(drawn)
    source = target = rescale(drawn, centre, scale)
    if corruption.sampling == "independent":
        other = sample(surface, corruption.num_points, generator=generator)
        target = rescale(other, centre, scale)
    source = crop(source, corruption.keep, generator=generator)
    target = crop(target, corruption.keep, generator=generator)
    _check_extent(source)
    _check_extent(target)
    pose = draw_pose(corruption.poses, generator=generator)
    target = move(target, pose)
    if corruption.jitter_deviation > 0:
        noise = corruption.jitter_deviation, corruption.jitter_clip
        source = jitter(source, *noise, generator=generator)
        target = jitter(target, *noise, generator=generator)
    target = shuffle(target, generator=generator)
    if not corruption.shape_points or not _leaves_shape(surface, corruption):
        return source, target, pose, None
    shape = _draw_shape(surface, corruption.shape_points, generator)
    return source, target, pose, rescale(shape, centre, scale)


def _leaves_shape(
    surface: Mesh | Float64[np.ndarray, "surface columns"], corruption: Corruption
) -> bool:
    """Whether the true pose leaves a distance between the clouds and their shape.

    Noise does; so does a mesh of which the clouds are parts or separate samples. Points of a cloud
    without noise are points of the shape, at distance 0.
    """
    apart = corruption.sampling == "independent" or corruption.keep < 1
    return corruption.jitter_deviation > 0 or (apart and isinstance(surface, Mesh))


def _draw_shape(
    surface: Mesh | Float64[np.ndarray, "surface columns"],
    count: int,
    generator: np.random.Generator,
) -> Float64[np.ndarray, "count 3"]:
    """Points of the whole item; of a cloud that has fewer all, repeated, which moves no minimum."""
    held = count if isinstance(surface, Mesh) else min(count, len(surface))
    return np.resize(sample_points(surface, held, generator=generator), (count, 3))


def _check_extent(points: SampledCloud) -> None:
    """Refuse a cloud that could be turned unseen: no pose is to be read from it."""
    if not spans_plane(points[:, :3]):
        distinct = len(np.unique(points[:, :3], axis=0))
        raise DegenerateShape(
            f"a pair needs a cloud with extent in two directions, got {distinct} distinct points on "
            "one line or in one place"
        )


def make_pairs(
    items: Sequence[RawItem],
    shown: Shown,
    corruption: Corruption,
    seed: Sequence[int],
    progress: Progress = silent,
    spread: Spread = in_turn,
) -> Iterator[Pairs]:
    """The pairs that are ``shown``, in blocks of at most ``BLOCK``; few are held at once.

    Pair k draws from its own generator, seeded ``(*seed, k)``: it does not depend on which pairs
    were made before, nor where.

    Raises:
        ValueError: An item cannot be read, is too small, or lacks normals that are to be given;
            the sentence names it.
        DegenerateShape: See :func:`make_pair`; the sentence names the item.
    """
    blocks = _blocks(shown)
    made = spread(
        partial(_make_block, corruption=corruption, seed=seed), _with_items(items, blocks)
    )
    for block, arrays in zip(progress(blocks, f"pairs, {BLOCK} at a time"), made, strict=True):
        index = [i for _, i in block]
        fields = {name: torch.from_numpy(values) for name, values in arrays.items()}
        group = tuple(items[i].group for i in index)
        yield Pairs(**fields, item=torch.tensor(index), group=group)


def find_degenerate(
    items: Sequence[RawItem],
    shown: Shown,
    corruption: Corruption,
    seed: Sequence[int],
    progress: Progress = silent,
    spread: Spread = in_turn,
) -> list[int]:
    """The numbers of the pairs that :func:`make_pairs` would refuse as degenerate.

    Raises:
        ValueError: What else it refuses.
    """
    blocks = _blocks(shown)
    find = partial(_degenerate_of_block, corruption=corruption, seed=seed)
    watched = progress(blocks, f"shapes looked at, {BLOCK} at a time")
    found = zip(watched, spread(find, _with_items(items, blocks)), strict=True)
    return [k for _, numbers in found for k in numbers]


def _blocks(shown: Shown) -> list[list[tuple[int, int]]]:
    """Each pair's number and the item that it shows, ``BLOCK`` at a time."""
    numbered = list(shown.items() if isinstance(shown, Mapping) else enumerate(shown))
    return [numbered[start : start + BLOCK] for start in range(0, len(numbered), BLOCK)]


def _with_items(
    items: Sequence[RawItem], blocks: Sequence[Sequence[tuple[int, int]]]
) -> Iterator[list[tuple[int, RawItem]]]:
    return ([(k, items[i]) for k, i in block] for block in blocks)


def choose_shown(index: Sequence[int], count: int | None, seed: Sequence[int]) -> list[int]:
    """Which of the items at ``index`` each of ``count`` pairs shows; None shows each once.

    Pair k shows item ``index[k % len(index)]`` after a shuffle.
    """
    if count is None:
        return list(index)
    order = np.random.default_rng(seed).permutation(index)
    return [int(order[k % len(order)]) for k in range(count)]


def _make_block(
    numbered: Sequence[tuple[int, RawItem]], corruption: Corruption, seed: Sequence[int]
) -> dict[str, np.ndarray]:
    """The fields of some pairs by name: clouds, poses, and normals and shapes where there are any."""
    made = [_make_numbered(k, item, corruption, seed) for k, item in numbered]
    *clouds, poses, shapes = zip(*made, strict=True)
    source, target = (np.stack(cloud).astype(np.float32) for cloud in clouds)
    fields = {
        "source": source[..., :3],
        "target": target[..., :3],
        "T_target_source": np.stack(poses),
    }
    if corruption.normals == "given":
        fields |= {"source_normals": source[..., 3:], "target_normals": target[..., 3:]}
    if shapes[0] is not None:
        fields["shape"] = np.stack(shapes).astype(np.float32)
    return fields


def _make_numbered(k: int, item: RawItem, corruption: Corruption, seed: Sequence[int]) -> MadePair:
    """Pair k; an error names its item."""
    try:
        generator = np.random.default_rng([*seed, k])
        return make_pair(item.read(), corruption, generator=generator)
    except ValueError as error:
        kind = DegenerateShape if isinstance(error, DegenerateShape) else ValueError
        raise kind(f"no pair of {item.name}: {error}") from error


def _degenerate_of_block(
    numbered: Sequence[tuple[int, RawItem]], corruption: Corruption, seed: Sequence[int]
) -> list[int]:
    found = []
    for k, item in numbered:
        try:
            _make_numbered(k, item, corruption, seed)
        except DegenerateShape:
            found.append(k)
    return found
