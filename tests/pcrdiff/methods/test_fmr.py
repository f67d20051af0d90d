"""What is particular to FMR; the loop itself is tested in models/test_lucas_kanade.py."""

import pytest
import torch

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.fmr import FMR
from pcrdiff.methods.pointnetlk import PointNetLK
from pcrdiff.models.losses import chamfer_loss, pose_loss
from pcrdiff.models.lucas_kanade import align
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def make(train_updates: int = 2, updates: int = 20) -> FMR:
    torch.manual_seed(0)
    return FMR(64, 40, 0.1, train_updates, updates)


def test_solves_exact_copies_even_untrained() -> None:
    pairs = synthetic_pairs(4, 256, generator=seeded(0))
    answer = make().register(pairs.source, pairs.target, generator=seeded(0)).double()
    assert error_r_deg(answer, pairs.T_target_source).median() < 0.1


def test_registers_as_pointnetlk_with_its_encoder_does_whatever_the_decoder() -> None:
    pairs, method = synthetic_pairs(3, 50, generator=seeded(0)), make(updates=3)
    twin = PointNetLK(64, 0.1, train_updates=2, updates=3)
    twin.encoder.load_state_dict(method.encoder.state_dict())
    with torch.no_grad():
        for parameter in method.decoder.parameters():
            parameter.zero_()
    answer, other = (
        m.register(pairs.source, pairs.target, generator=seeded(0)) for m in (method, twin)
    )
    assert torch.equal(answer, other)


def test_a_decoded_cloud_has_its_own_number_of_points_within_the_unit_cube() -> None:
    decoded = make().decode(100 * synthetic_pairs(3, 50, generator=seeded(0)).source)
    assert decoded.shape == (3, 40, 3)
    assert decoded.abs().max() <= 1


def test_the_losses_are_of_both_clouds_decoded_and_of_the_pose_after_each_update() -> None:
    pairs, method = synthetic_pairs(3, 50, generator=seeded(0)), make(train_updates=2, updates=1)
    terms = method.loss(pairs, generator=seeded(0))
    poses = align(method.encoder, pairs.source, pairs.target, 0.1, 2)
    pose = sum(pose_loss(T, pairs.T_target_source).item() for T in poses) / 2
    p = pairs.source - pairs.source.mean(dim=1, keepdim=True)
    q = pairs.target - pairs.target.mean(dim=1, keepdim=True)
    decoded = sum(chamfer_loss(method.decode(cloud), cloud).item() for cloud in (p, q))
    assert terms["pose"].item() == pytest.approx(pose, rel=1e-5)
    assert terms["decoded"].item() == pytest.approx(decoded, rel=1e-5)
    assert set(terms) == {"decoded", "pose"}


def test_what_is_decoded_does_not_depend_on_where_the_clouds_lie() -> None:
    pairs, method = synthetic_pairs(3, 50, generator=seeded(0)), make()
    T = torch.eye(4).repeat(3, 1, 1)
    T[:, :3, 3] = torch.tensor([3.0, -2.0, 1.0])
    here = method.loss(pairs, generator=seeded(0))["decoded"].item()
    pairs.target.copy_(transform(T, pairs.target))
    there = method.loss(pairs, generator=seeded(0))["decoded"].item()
    assert there == pytest.approx(here, rel=1e-4)


def test_learns_to_decode() -> None:
    pairs, method = synthetic_pairs(8, 50, generator=seeded(0)), make()
    optimizer = torch.optim.Adam(method.parameters(), lr=1e-3)
    losses = []
    for _ in range(30):
        terms = method.loss(pairs, generator=seeded(0))
        optimizer.zero_grad()
        torch.autograd.backward(torch.stack(list(terms.values())).sum())
        optimizer.step()
        losses.append(terms["decoded"].item())
    assert losses[-1] < 0.5 * losses[0]
