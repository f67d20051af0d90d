"""Neighbourhoods: the same as SciPy's trees, whatever the blocks."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from scipy.spatial.distance import cdist

from pcrdiff.geometry import neighbors
from pcrdiff.geometry.neighbors import (
    estimate_normals,
    gather_points,
    nearest,
    nearest_by_distances,
    nearest_by_trees,
    row_argmax,
    squared_distances,
)
from pcrdiff.geometry.rigid import transform
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded

Search = Callable[[torch.Tensor, torch.Tensor, int], tuple[torch.Tensor, torch.Tensor]]


def random_clouds(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, 3, generator=seeded(seed), dtype=torch.float64)


@pytest.mark.parametrize("batch", [(), (1,), (3, 2)])
def test_squared_distances_agree_with_scipy(batch: tuple[int, ...]) -> None:
    a, b = random_clouds(*batch, 5, seed=1), random_clouds(*batch, 8, seed=2)
    distances = squared_distances(a, b)
    flat = zip(a.reshape(-1, 5, 3), b.reshape(-1, 8, 3), strict=True)
    expected = np.stack([cdist(p.numpy(), q.numpy(), "sqeuclidean") for p, q in flat])
    np.testing.assert_allclose(distances.reshape(-1, 5, 8).numpy(), expected, atol=1e-13)


def test_squared_distances_are_never_negative() -> None:
    points = 100 + random_clouds(200).float()
    assert (squared_distances(points, points) >= 0).all()


@pytest.mark.parametrize("search", [nearest, nearest_by_trees, nearest_by_distances])
def test_nearest_agrees_with_sorted_distances(search: Search) -> None:
    queries, points = random_clouds(2, 30, seed=3), random_clouds(2, 50, seed=4)
    distances, index = search(queries, points, 6)
    for i in range(2):
        expected = cdist(queries[i].numpy(), points[i].numpy(), "sqeuclidean")
        np.testing.assert_array_equal(index[i].numpy(), expected.argsort(axis=1)[:, :6])
        np.testing.assert_allclose(distances[i].numpy(), np.sort(expected)[:, :6])


def test_both_searches_find_the_one_nearest_point() -> None:
    queries, points = random_clouds(2, 30, seed=3), random_clouds(2, 50, seed=4)
    for ours, twin in zip(
        nearest_by_trees(queries, points, 1), nearest_by_distances(queries, points, 1), strict=True
    ):
        assert ours.shape == (2, 30, 1)
        torch.testing.assert_close(ours, twin)


def test_distances_do_not_depend_on_the_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    queries, points = random_clouds(2, 31, seed=5), random_clouds(2, 50, seed=6)
    whole = nearest_by_distances(queries, points, 4)
    for block in (1, 2 * 50 * 7):
        monkeypatch.setattr(neighbors, "BLOCK", block)
        for part, expected in zip(nearest_by_distances(queries, points, 4), whole, strict=True):
            torch.testing.assert_close(part, expected)


def test_nearest_refuses_more_neighbours_than_points() -> None:
    with pytest.raises(ValueError, match="at least k = 6 points, got 5"):
        nearest(random_clouds(1, 9), random_clouds(1, 5), 6)


def test_gather_points_picks_from_the_right_cloud() -> None:
    values = torch.arange(2 * 4 * 3.0).reshape(2, 4, 3)
    index = torch.randint(4, (2, 5, 2), generator=seeded(7))
    gathered = gather_points(values, index)
    for b in range(2):
        for i in range(5):
            for j in range(2):
                assert (gathered[b, i, j] == values[b, index[b, i, j]]).all()


def normals_of(points: torch.Tensor, k: int) -> torch.Tensor:
    return estimate_normals(points, nearest(points, points, k)[1])


def test_normals_of_a_sphere_point_outward_along_the_radius() -> None:
    sphere = torch.nn.functional.normalize(random_clouds(1, 2000), dim=-1)
    normals = normals_of(sphere, 12)
    torch.testing.assert_close(normals.norm(dim=-1), torch.ones(1, 2000, dtype=torch.float64))
    assert (normals * sphere).sum(dim=-1).min() > 0.95


def test_normals_of_a_tilted_plane_are_the_planes() -> None:
    flat = random_clouds(1, 100) * torch.tensor([1.0, 1.0, 0.0])
    T = random_poses(1, generator=seeded(8))
    normals = normals_of(transform(T, flat), 8)
    expected = T[:, :3, 2].unsqueeze(1).expand_as(normals)
    torch.testing.assert_close(
        (normals * expected).sum(dim=-1).abs(), torch.ones_like(normals[..., 0])
    )


def test_a_moved_cloud_has_moved_normals() -> None:
    points = lopsided_clouds(2, 200, generator=seeded(9)).double()
    T = random_poses(2, generator=seeded(10))
    turned = normals_of(points, 10) @ T[:, :3, :3].mT
    torch.testing.assert_close(normals_of(transform(T, points), 10), turned)


def test_the_largest_of_each_row_is_found() -> None:
    scores = torch.randn(50, 301, generator=seeded(0))
    assert torch.equal(row_argmax(scores), scores.argmax(dim=-1))


def test_of_equals_it_is_the_first() -> None:
    assert row_argmax(torch.tensor([[1.0, 3.0, 3.0], [2.0, 2.0, 2.0]])).tolist() == [1, 0]


def test_rows_need_not_lie_along_memory() -> None:
    scores = torch.randn(7, 5, generator=seeded(1)).mT
    assert torch.equal(row_argmax(scores), scores.argmax(dim=-1))
