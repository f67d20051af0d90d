"""EGST's descriptors: what turns with the cloud, what does not, and the same in any blocks."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry import neighbors
from pcrdiff.geometry.neighbors import estimate_normals, nearest
from pcrdiff.geometry.rigid import transform
from pcrdiff.geometry.rotation import angle_between
from pcrdiff.models import structure
from pcrdiff.models.structure import (
    DESCRIPTOR_DIM,
    StructureEmbedding,
    describe,
    describe_pairs,
    move,
    widest_angle,
)
from tests.pcrdiff.largest_tensor import LargestTensor
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded

RADIUS, K = 0.4, 8


def clouds(n: int = 120) -> Tensor:
    return lopsided_clouds(2, n, generator=seeded(0)).double()


def slow_widest_angle(points: Tensor, index: Tensor) -> Tensor:
    """Triplet by triplet, for one cloud whose points are all distinct."""
    widest = torch.full(index.shape, torch.pi / 2, dtype=points.dtype)
    for i, neighbours in enumerate(index.tolist()):
        for place, j in enumerate(neighbours):
            if j != i:
                others = points[[m for m in range(len(points)) if m != i]] - points[i]
                to_j = (points[j] - points[i]).expand_as(others)
                widest[i, place] = angle_between(to_j, others).max()
    return widest


def test_the_pair_feature_and_the_widest_angle_do_not_change_when_the_cloud_moves() -> None:
    points, T = clouds(), random_poses(2, generator=seeded(1))
    before, after = (
        describe(points, None, RADIUS, K),
        describe(transform(T, points), None, RADIUS, K),
    )
    torch.testing.assert_close(after[..., 6:], before[..., 6:], atol=1e-6, rtol=0)


def test_the_centre_and_the_offset_turn_with_the_cloud() -> None:
    points, T = clouds(), random_poses(2, generator=seeded(2))
    before, after = (
        describe(points, None, RADIUS, K),
        describe(transform(T, points), None, RADIUS, K),
    )
    R = T[:, None, :3, :3].mT
    torch.testing.assert_close(after[..., :3], before[..., :3] @ R)
    torch.testing.assert_close(after[..., 3:6], before[..., 3:6] @ R)


def test_descriptors_follow_the_order_of_the_points() -> None:
    points, order = clouds(), torch.randperm(120, generator=seeded(3))
    shuffled = describe(points[:, order], None, RADIUS, K)
    torch.testing.assert_close(
        shuffled, describe(points, None, RADIUS, K)[:, order], atol=1e-7, rtol=0
    )


def test_descriptors_are_what_the_docstring_says() -> None:
    points = clouds()
    described = describe(points, None, RADIUS, K)
    assert described.shape == (2, 120, K, 11)
    centre, offset, length = described[..., :3], described[..., 3:6], described[..., 9]
    torch.testing.assert_close(centre.mean(dim=1), torch.zeros(2, K, 3, dtype=torch.float64))
    torch.testing.assert_close(centre[:, :, 0] - centre[:, :1, 0], points - points[:, :1])
    torch.testing.assert_close(offset.norm(dim=-1), length)
    assert (length <= RADIUS).all()
    assert (length[..., 0] == 0).all()  # the nearest point is the centre itself
    assert (
        (described[..., [6, 7, 8, 10]] >= 0) & (described[..., [6, 7, 8, 10]] <= torch.pi)
    ).all()


def test_a_place_without_a_neighbour_holds_the_centre() -> None:
    lonely = torch.cat([clouds(), torch.full((2, 1, 3), 50.0, dtype=torch.float64)], dim=1)
    offset = describe(lonely, None, RADIUS, K)[:, -1, :, 3:6]
    assert (offset == 0).all()


def outward(points: Tensor) -> Tensor:
    """A unit vector per point that turns with the cloud about its mean."""
    return torch.nn.functional.normalize(points - points.mean(dim=1, keepdim=True), dim=-1)


def test_the_pair_feature_of_rpm_net_does_not_change_when_the_cloud_moves() -> None:
    points, T = clouds(), random_poses(2, generator=seeded(1))
    moved = transform(T, points)
    for normals, turned in ((None, None), (outward(points), outward(moved))):
        before = describe_pairs(points, normals, RADIUS, K)
        after = describe_pairs(moved, turned, RADIUS, K)
        assert before.shape == (2, 120, K, 10)
        torch.testing.assert_close(after[..., 6:], before[..., 6:], atol=1e-6, rtol=0)


def test_given_normals_have_a_direction_and_estimated_ones_are_lines() -> None:
    points = clouds()
    estimated = estimate_normals(points, nearest(points, points, K)[1])
    directed = describe_pairs(points, estimated, RADIUS, K)
    folded = describe_pairs(points, None, RADIUS, K)
    assert folded[..., 6:9].max() <= torch.pi / 2
    assert directed[..., 6:9].max() > torch.pi / 2
    torch.testing.assert_close(folded[..., 6:9].sin(), directed[..., 6:9].sin())
    torch.testing.assert_close(folded[..., :6], directed[..., :6])
    torch.testing.assert_close(folded[..., 9], directed[..., 9])


def test_the_two_describe_alike_what_they_share() -> None:
    points = clouds()
    normals = estimate_normals(points, nearest(points, points, K)[1])
    whole = describe(points, None, RADIUS, K)
    assert torch.equal(describe(points, normals, RADIUS, K), whole)
    assert torch.equal(describe_pairs(points, normals, RADIUS, K), whole[..., :10])
    assert not torch.allclose(describe(points, outward(points), RADIUS, K), whole)


def test_a_motion_of_descriptors_is_that_of_the_cloud_about_its_old_mean() -> None:
    points, T = clouds(), random_poses(2, generator=seeded(2))
    points = points - points.mean(dim=1, keepdim=True)
    moved = move(describe(points, None, RADIUS, K), T)
    expected = describe(transform(T, points), None, RADIUS, K)
    expected[..., :3] += T[:, None, None, :3, 3]  # its own mean is the translation
    torch.testing.assert_close(moved, expected, atol=1e-6, rtol=0)


def test_blocks_give_what_one_block_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = describe(clouds(), None, RADIUS, K)
    for block in (1, 2 * K * 120 * 7):
        monkeypatch.setattr(structure, "TRIPLETS", block)
        monkeypatch.setattr(neighbors, "BLOCK", block)
        torch.testing.assert_close(describe(clouds(), None, RADIUS, K), whole, atol=1e-7, rtol=0)


def test_no_tensor_grows_with_the_square_of_the_points(monkeypatch: pytest.MonkeyPatch) -> None:
    n, block = 600, 30_000
    monkeypatch.setattr(structure, "TRIPLETS", block)
    monkeypatch.setattr(neighbors, "BLOCK", block)
    points = lopsided_clouds(1, n, generator=seeded(4))
    with LargestTensor() as watch:
        describe(points, None, RADIUS, K)
    largest = watch.entries
    assert n * K * 11 <= largest <= 2 * n * K * 11  # the answer itself; n * n * K is 50 times that
    assert n * K * n > 20 * largest


def test_the_widest_angle_agrees_with_a_slow_twin() -> None:
    points = torch.randn(2, 25, 3, generator=seeded(5), dtype=torch.float64)
    _, index = nearest(points, points, 5)
    index[:, :, -1] = torch.arange(25)  # a place left over
    expected = torch.stack([slow_widest_angle(p, i) for p, i in zip(points, index, strict=True)])
    assert expected.min() < torch.pi / 2 - 0.1
    torch.testing.assert_close(widest_angle(points, index), expected, atol=1e-7, rtol=0)


def test_a_corner_of_a_tetrahedron_spans_60_degrees() -> None:
    corners = torch.tensor([[[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]])
    index = torch.tensor([[[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]])
    angles = widest_angle(corners, index)
    torch.testing.assert_close(angles, torch.full((1, 4, 3), torch.pi / 3))


def test_refuses_fewer_points_than_neighbours() -> None:
    with pytest.raises(ValueError, match="at least k = 8 points, got 7"):
        describe(clouds(7), None, RADIUS, K)


def test_a_feature_does_not_depend_on_the_order_of_neighbours_but_on_its_own_point() -> None:
    torch.manual_seed(0)
    embed = StructureEmbedding(16, DESCRIPTOR_DIM)
    described = describe(clouds().float(), None, RADIUS, K)
    features = embed(described)
    assert features.shape == (2, 120, 16)
    torch.testing.assert_close(embed(described.flip(2)), features)
    torch.testing.assert_close(embed(described.flip(1)), features.flip(1))
    assert len(torch.unique(features[0], dim=0)) == 120
