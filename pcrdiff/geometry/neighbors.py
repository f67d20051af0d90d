"""Which points are near which, in memory that grows with the number of points."""

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree
from torch import Tensor

Queries = Float[Tensor, "batch n dim"]
Points = Float[Tensor, "batch m dim"]
Found = tuple[Float[Tensor, "batch n k"], Int[Tensor, "batch n k"]]
"""Squared distance and index of each query's nearest points."""
BLOCK = 1 << 22
"""Distances held at once; 16 MiB in float32."""


def squared_distances(
    a: Float[Tensor, "*batch n dim"], b: Float[Tensor, "*batch m dim"]
) -> Float[Tensor, "*batch n m"]:
    """``|a_i - b_j|^2``, never negative."""
    cross = a @ b.mT
    squares = a.square().sum(dim=-1).unsqueeze(-1) + b.square().sum(dim=-1).unsqueeze(-2)
    return (squares - 2 * cross).clamp(min=0)


def nearest(queries: Queries, points: Points, k: int) -> Found:
    """Squared distance and index of the ``k`` nearest points of each query, nearest first.

    Raises:
        ValueError: There are fewer than ``k`` points.
    """
    if k > points.shape[1]:
        raise ValueError(f"nearest needs at least k = {k} points, got {points.shape[1]}")
    search = nearest_by_trees if points.device.type == "cpu" else nearest_by_distances
    return search(queries.detach(), points.detach(), k)


def nearest_by_trees(queries: Queries, points: Points, k: int) -> Found:
    """:func:`nearest` by a k-d tree of each cloud, in float64."""
    ranks, workers = np.arange(1, k + 1), torch.get_num_threads()  # which change no answer
    found = [
        cKDTree(cloud.numpy()).query(asked.numpy(), ranks, workers=workers)
        for asked, cloud in zip(queries, points, strict=True)
    ]
    distances = torch.from_numpy(np.stack([each for each, _ in found]))
    index = torch.from_numpy(np.stack([each for _, each in found]))
    return distances.square().to(points), index


def nearest_by_distances(queries: Queries, points: Points, k: int) -> Found:
    """:func:`nearest` by all distances, a block at a time: what accelerators are good at."""
    batch, m, _ = points.shape
    rows = max(1, BLOCK // (batch * m))
    blocks = [
        squared_distances(block, points).topk(k, dim=-1, largest=False)
        for block in torch.split(queries, rows, dim=1)
    ]
    distances = torch.cat([block.values for block in blocks], dim=1)
    return distances, torch.cat([block.indices for block in blocks], dim=1)


def row_argmax(scores: Float[Tensor, "rows n"]) -> Int[Tensor, " rows"]:
    """Index of each row's largest entry, the first of equals.

    NumPy's search of contiguous rows takes a tenth of the time of torch's on a processor.
    """
    if scores.device.type != "cpu":
        return scores.argmax(dim=-1)
    return torch.from_numpy(scores.numpy().argmax(axis=-1))


def gather_points(
    values: Float[Tensor, "batch m dim"], index: Int[Tensor, "batch n k"]
) -> Float[Tensor, "batch n k dim"]:
    """``values[b, index[b, i, j]]``."""
    items = torch.arange(len(values), device=values.device)[:, None, None]
    return values[items, index]


def estimate_normals(
    points: Float[Tensor, "batch n 3"], index: Int[Tensor, "batch n k"]
) -> Float[Tensor, "batch n 3"]:
    """Unit normal of the plane through each point's neighbours at ``index``.

    The sign points away from the cloud's centroid, so that a moved cloud has moved normals.
    """
    patches = gather_points(points, index)
    centred = patches - patches.mean(dim=-2, keepdim=True)
    _, axes = torch.linalg.eigh(centred.mT @ centred)
    normals = axes[..., 0]  # of the smallest eigenvalue
    outward = points - points.mean(dim=-2, keepdim=True)
    away = (normals * outward).sum(dim=-1, keepdim=True) >= 0
    return torch.where(away, normals, -normals)
