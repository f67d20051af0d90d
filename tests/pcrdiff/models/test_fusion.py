"""The three ways to fuse the noisy pose's feature."""

import pytest
import torch

from pcrdiff.models.fusion import FEATURES, Fusion, fuse
from tests.pcrdiff.made_up_clouds import seeded

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
