"""PointNet: a cloud's feature and, through the critical points, the plain network's gradient."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.precision import set_search_precision
from pcrdiff.models import pointnet
from pcrdiff.models.pointnet import PointNet, at_critical
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, seeded


def make(ins: int = 3) -> PointNet:
    torch.manual_seed(0)
    return PointNet((16, 32, 64), ins=ins).double()


def clouds(batch: int = 3, n: int = 40) -> Tensor:
    return lopsided_clouds(batch, n, generator=seeded(1)).double()


def plain(network: PointNet, points: Tensor) -> Tensor:
    """What the docstring says, without any shortcut."""
    pooled: Tensor = network.per_point(points).amax(dim=-2)
    return pooled


def test_gradients_through_the_critical_points_are_the_plain_networks() -> None:
    network, weight = make(), torch.randn(3, 64, generator=seeded(2), dtype=torch.float64)
    points = clouds().requires_grad_()
    wanted = [*network.parameters(), points]
    ours = torch.autograd.grad((network(points) * weight).sum(), wanted)
    theirs = torch.autograd.grad((plain(network, points) * weight).sum(), wanted)
    for a, b in zip(ours, theirs, strict=True):
        assert b.abs().max() > 1e-3
        assert (a - b).abs().max() < 1e-12


@pytest.mark.parametrize("n", [1, 2, 40])
def test_the_feature_is_the_same_with_and_without_a_gradient(n: int) -> None:
    network, points = make(), clouds(n=n)
    with_gradient = network(points)
    with torch.no_grad():
        torch.testing.assert_close(network(points), with_gradient, atol=1e-14, rtol=0)
    torch.testing.assert_close(with_gradient, plain(network, points), atol=1e-14, rtol=0)


def test_a_critical_point_attains_its_maximum() -> None:
    network, points = make(), clouds()
    critical = network.critical_points(points)
    features = network.per_point(points.flatten(0, 1)).gather(0, critical)
    torch.testing.assert_close(features, plain(network, points), atol=1e-14, rtol=0)
    assert (critical // 40 == torch.arange(3).unsqueeze(-1)).all()  # each cloud its own


def test_the_order_and_the_repetition_of_points_do_not_matter() -> None:
    network, points = make(), clouds()
    shuffled = points[:, torch.randperm(40, generator=seeded(3))]
    torch.testing.assert_close(network(shuffled), network(points))
    torch.testing.assert_close(network(torch.cat([points, points[:, :7]], 1)), network(points))


def test_a_batch_is_a_loop_over_its_clouds() -> None:
    network, points = make(), clouds()
    torch.testing.assert_close(network(points), torch.cat([network(p[None]) for p in points]))


def test_points_may_carry_more_than_three_numbers() -> None:
    points = torch.randn(2, 9, 4, generator=seeded(4), dtype=torch.float64)
    network = make(ins=4)
    torch.testing.assert_close(network(points), plain(network, points))


@pytest.mark.usefixtures("processor")
def test_float32_gradients_are_the_plain_networks() -> None:
    network, points = make().float(), clouds(batch=8, n=300).float()
    weight = torch.randn(8, 64, generator=seeded(2))
    ours = torch.autograd.grad((network(points) * weight).sum(), [*network.parameters()])
    theirs = torch.autograd.grad((plain(network, points) * weight).sum(), [*network.parameters()])
    for a, b in zip(ours, theirs, strict=True):
        assert (a - b).norm() / b.norm() < 1e-5


def test_a_linear_layer_at_critical_rows_has_the_gradient_of_its_formula() -> None:
    hidden, weight = (
        torch.randn(rows, 5, generator=seeded(rows), dtype=torch.float64, requires_grad=True)
        for rows in (12, 7)
    )
    place = torch.randint(6, (2, 7), generator=seeded(0)) + torch.tensor([[0], [6]])
    picked = at_critical(hidden, weight, place)
    torch.testing.assert_close(picked, (hidden[place] * weight).sum(dim=-1))
    assert torch.autograd.gradcheck(lambda h, w: at_critical(h, w, place), (hidden, weight))


def taken_point_features(network: PointNet, points: Tensor) -> Tensor:
    """The plain network's features of the points that the search takes."""
    features: Tensor = network.per_point(points.flatten(0, 1))
    return features.gather(0, network.critical_points(points))


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize("graph", [True, False])
def test_in_bfloat16_the_values_are_those_of_the_points_taken(graph: bool) -> None:
    """On a processor that has it and on one that has not."""
    network, points = make().float(), clouds(n=400).float()
    set_search_precision("bfloat16")
    with torch.set_grad_enabled(graph):
        found, taken = network(points), taken_point_features(network, points)
    torch.testing.assert_close(found, taken)


@pytest.mark.usefixtures("processor")
def test_in_bfloat16_the_gradients_are_those_of_the_points_taken() -> None:
    network, points = make().float(), clouds(batch=8, n=300).float()
    weight = torch.randn(8, 64, generator=seeded(2))
    set_search_precision("bfloat16")
    wanted = [*network.parameters()]
    ours = torch.autograd.grad((network(points) * weight).sum(), wanted)
    taken = taken_point_features(network, points)
    theirs = torch.autograd.grad((taken * weight).sum(), wanted)
    for a, b in zip(ours, theirs, strict=True):
        assert (a - b).norm() / b.norm() < 1e-5


@pytest.mark.usefixtures("processor")
def test_in_bfloat16_a_point_taken_is_as_high_as_the_highest_but_for_rounding() -> None:
    """Each factor is off by 2^-8 at most, so a score by 2^-7 of the sum of its terms' sizes."""
    network, points = make().float(), clouds(batch=8, n=300).float()
    set_search_precision("bfloat16")
    with torch.no_grad():
        critical = network.critical_points(points)
        hidden = network.hidden(points.flatten(0, 1))
        scores = hidden @ network.last.weight.mT
        sizes = (hidden.abs() @ network.last.weight.abs().mT).view(8, 300, 64).amax(dim=1)
        lost = scores.view(8, 300, 64).amax(dim=1) - scores.gather(0, critical)
    assert (lost >= 0).all()
    assert (lost <= 2 * 2**-7 * sizes).all()
    assert lost.max() > 0  # or it was no search in bfloat16


def test_many_points_are_scored_in_blocks() -> None:
    network, points = make(), clouds(batch=2, n=2 * pointnet.BLOCK + 5)
    with torch.no_grad():
        torch.testing.assert_close(network(points), plain(network, points), atol=1e-13, rtol=0)
