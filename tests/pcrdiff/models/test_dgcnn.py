"""DGCNN: what a point's feature hangs on, and that it is what its docstring says."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.rigid import transform
from pcrdiff.models.dgcnn import DGCNN
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, seeded, small_pose

K = 5


def make() -> DGCNN:
    torch.manual_seed(0)
    return DGCNN(32, K).double()


def clouds(n: int = 40) -> Tensor:
    return lopsided_clouds(2, n, generator=seeded(0)).double()


def slow_features(net: DGCNN, cloud: Tensor) -> Tensor:
    """Point by point, edge by edge."""
    centred, rows = cloud - cloud.mean(dim=0), []
    for centre in centred:
        order = (centred - centre).norm(dim=-1).argsort()[:K]
        edges = [torch.cat([centred[j], centre]) for j in order.tolist()]
        maxima = []
        for layer in net.per_edge:
            edges = [layer(edge).clamp(min=0) for edge in edges]
            maxima.append(torch.stack(edges).max(dim=0).values)
        rows.append(net.join(torch.cat(maxima)))
    return torch.stack(rows)


def test_agrees_with_a_slow_twin() -> None:
    net, points = make(), clouds()
    expected = torch.stack([slow_features(net, cloud) for cloud in points])
    assert expected.std() > 0.01
    torch.testing.assert_close(net(points), expected)


def test_features_follow_the_order_of_the_points() -> None:
    net, order = make(), torch.randperm(40, generator=seeded(1))
    torch.testing.assert_close(net(clouds()[:, order]), net(clouds())[:, order])


def test_features_do_not_change_when_the_cloud_is_shifted_but_do_when_it_is_turned() -> None:
    net, points = make(), clouds()
    shifted = transform(small_pose(0, (1.0, -2.0, 0.5)).expand(2, 4, 4), points)
    turned = transform(small_pose(20, (0, 0, 0)).expand(2, 4, 4), points)
    torch.testing.assert_close(net(shifted), net(points))
    assert (net(turned) - net(points)).abs().max() > 0.01


def test_a_cloud_is_encoded_by_itself() -> None:
    net, points = make(), clouds()
    torch.testing.assert_close(net(points[1:]), net(points)[1:])


def test_a_point_knows_its_neighbours_only() -> None:
    net, points = make(), clouds()
    there = (points[0, 0] - points[0]).norm(dim=-1).argsort()
    farthest, nearest = there[-2:], there[1:3]

    def change(two: Tensor) -> Tensor:
        """Of the features of point 0 where two points part, their mean kept in its place."""
        moved = points.clone()
        moved[0, two] += 0.1 * torch.tensor([[1.0], [-1.0]], dtype=torch.float64)
        apart: Tensor = net(moved) - net(points)
        return apart[0, 0].abs().max()

    assert change(farthest) < 1e-12
    assert change(nearest) > 1e-3


def test_every_weight_is_trained() -> None:
    net = make()
    torch.autograd.backward(net(clouds()).square().mean())
    for name, parameter in net.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().max() > 0, name


def test_refuses_fewer_points_than_neighbours() -> None:
    with pytest.raises(ValueError, match="at least k = 5 points, got 4"):
        make()(clouds(4))
