"""F_t: zero at the start, different for other poses and times once trained, and its fusion."""

import math

import pytest
import torch

from pcrdiff.models.pose_encoder import (
    FEATURES,
    Fusion,
    PoseEncoder,
    fuse,
    make_pose_encoder,
    time_embedding,
)
from tests.pcrdiff.synthetic_clouds import seeded


def awake() -> PoseEncoder:
    """As if training had moved its last layers."""
    torch.manual_seed(0)
    encoder = PoseEncoder(pose_dim=7, dim=16)
    for parameter in encoder.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return encoder


def test_starts_as_if_there_were_no_diffusion() -> None:
    encoder = PoseEncoder(pose_dim=7, dim=16)
    x_t = torch.randn(4, 7, generator=seeded(0))
    assert (encoder(x_t, torch.tensor([1, 10, 500, 1000])) == 0).all()


def test_but_its_last_layers_learn_from_the_first_step() -> None:
    encoder = PoseEncoder(pose_dim=7, dim=16)
    encoder(torch.randn(4, 7, generator=seeded(0)), torch.full((4,), 3)).sum().backward()
    for last in (encoder.pose[-1], encoder.time[-1]):
        gradient = last.get_parameter("weight").grad
        assert gradient is not None
        assert gradient.abs().max() > 0


def test_tells_times_and_poses_apart_row_by_row() -> None:
    encoder, x_t = awake(), torch.randn(1, 7, generator=seeded(1)).repeat(3, 1)
    x_t[2] += 1
    encoded = encoder(x_t, torch.tensor([5, 6, 5]))
    assert encoded.shape == (3, 16)
    assert not torch.allclose(encoded[0], encoded[1])
    assert not torch.allclose(encoded[0], encoded[2])
    torch.testing.assert_close(encoder(x_t[2:], torch.tensor([5])), encoded[2:])


def test_the_time_embedding_worked_by_hand() -> None:
    # two frequencies: 1 and 10000^(-1/2) = 0.01
    expected = [math.sin(3), math.sin(0.03), math.cos(3), math.cos(0.03)]
    torch.testing.assert_close(time_embedding(torch.tensor([3]), 4), torch.tensor([expected]))


@pytest.mark.parametrize("dim", [32, 128])
def test_no_two_times_of_the_schedule_look_alike(dim: int) -> None:
    embedded = time_embedding(torch.arange(1001), dim)
    gaps = torch.cdist(embedded, embedded) + 10 * torch.eye(1001)
    assert gaps.min() > 0.05


def test_without_diffusion_nothing_is_passed_on_of_the_pose() -> None:
    silent = make_pose_encoder("without", pose_dim=7, dim=16)
    x_t = torch.randn(4, 7, generator=seeded(0))
    assert torch.equal(silent(x_t, torch.full((4,), 3)), torch.zeros(4, 16))
    assert list(silent.parameters()) == []
    assert isinstance(make_pose_encoder("with", pose_dim=7, dim=16), PoseEncoder)


POSE, SOURCE, TARGET = torch.randn(3, 5, 8, generator=seeded(0))


@pytest.mark.parametrize("fusion", list(FEATURES))
def test_is_as_wide_as_it_says(fusion: Fusion) -> None:
    assert fuse(fusion, POSE, SOURCE, TARGET).shape == (5, 8 * FEATURES[fusion])


@pytest.mark.parametrize("fusion", list(FEATURES))
def test_the_pose_changes_only_the_part_it_joins(fusion: Fusion) -> None:
    changed = fuse(fusion, POSE, SOURCE, TARGET) != fuse(fusion, POSE + 1, SOURCE, TARGET)
    part = {"source": 0, "target": 1, "concat": 2}[fusion]
    expected = [index == part for index in range(FEATURES[fusion])]
    assert [bool(block.all()) for block in torch.split(changed, 8, dim=-1)] == expected
    assert [bool(block.any()) for block in torch.split(changed, 8, dim=-1)] == expected


@pytest.mark.parametrize("fusion", list(FEATURES))
def test_a_silent_pose_leaves_both_clouds_features_as_they_are(fusion: Fusion) -> None:
    fused = fuse(fusion, torch.zeros(5, 8), SOURCE, TARGET)
    assert torch.equal(fused[:, :16], torch.cat([SOURCE, TARGET], dim=-1))
