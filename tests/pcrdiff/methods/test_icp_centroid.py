"""ICP from the shift between the centroids."""

import pytest
import torch

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.icp_centroid import ICPCentroid
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs

METHOD = ICPCentroid(100, 0.5)


def test_the_answer_follows_when_the_target_turns_a_little() -> None:
    pairs = synthetic_pairs(3, 300, generator=seeded(2))
    turn = small_pose(-10, (0.5, 0.2, -0.3)).expand(3, 4, 4)
    source, target = pairs.source.double(), pairs.target.double()
    answer = METHOD.register(source, target, generator=seeded(0))
    moved = METHOD.register(source, transform(turn, target), generator=seeded(0))
    assert error_r_deg(moved, turn @ answer).max() < 0.01
    assert error_t(moved, turn @ answer).max() < 1e-4


def test_refuses_clouds_of_which_no_two_points_are_within_reach() -> None:
    pairs = synthetic_pairs(1, 50, generator=seeded(5))
    ring = 100 * torch.nn.functional.normalize(pairs.target - pairs.target.mean(dim=1), dim=-1)
    with pytest.raises(ValueError, match=r"^icp\w* "):
        METHOD.register(pairs.source, torch.cat([ring, -ring], dim=1), generator=seeded(0))
