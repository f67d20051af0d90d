"""Fewer points of the same pairs, drawn again in every epoch: a step costs their square."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Int64

from pcrdiff.geometry.neighbors import nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.registration import Pairs

Some = Int64[np.ndarray, " of_source"]
Others = Int64[np.ndarray, " of_target"]


def thin(pairs: Pairs, count: int, generators: Sequence[np.random.Generator]) -> Pairs:
    """At most ``count`` random points of each cloud, with as many counterparts as there were.

    Points that the true pose lays nearest to each other stay or go together, so that exact copies
    stay exact copies; of the others each cloud keeps a random part. One generator a pair.
    """
    if max(pairs.source.shape[1], pairs.target.shape[1]) <= count:
        return pairs
    moved = transform(pairs.T_target_source, pairs.source.double()).to(pairs.target)
    to_target = nearest(moved, pairs.target, 1)[1][..., 0].numpy()
    to_source = nearest(pairs.target, moved, 1)[1][..., 0].numpy()
    chosen = [
        _choose(there, back, count, generator=generator)
        for there, back, generator in zip(to_target, to_source, generators, strict=True)
    ]
    p, q = (torch.from_numpy(np.stack(index)) for index in zip(*chosen, strict=True))
    return pairs.take_points(p, q)


def _choose(
    to_target: Int64[np.ndarray, " n"],
    to_source: Int64[np.ndarray, " m"],
    count: int,
    *,
    generator: np.random.Generator,
) -> tuple[Some, Others]:
    """Which points of source and target stay, from the nearest of each in the other cloud."""
    source = generator.permutation(len(to_target))[:count]
    mutual = to_source[to_target] == np.arange(len(to_target))
    counterparts = to_target[source[mutual[source]]]
    others = np.setdiff1d(np.arange(len(to_source)), to_target[mutual])
    spare = np.setdiff1d(to_target[mutual], counterparts)
    rest = [generator.permutation(index) for index in (others, spare)]
    target = np.concatenate([counterparts, *rest])[:count]
    return source, generator.permutation(target)
