"""Features to a step of the pose vector."""

import torch

from pcrdiff.models.pose_head import PoseHead
from tests.pcrdiff.made_up_clouds import seeded


def make() -> PoseHead:
    torch.manual_seed(0)
    return PoseHead(dim=32, widths=(24, 12), outs=9)


def test_gives_one_step_a_pair_with_as_many_entries_as_asked() -> None:
    step = make()(10 * torch.randn(50, 32, generator=seeded(0)))
    assert step.shape == (50, 9)
    assert (step.std(dim=0) > 0).all()


def test_takes_steps_both_ways() -> None:
    step = make()(torch.randn(200, 32, generator=seeded(1)))
    assert (step.amin(dim=0) < 0).all()
    assert (step.amax(dim=0) > 0).all()


def test_which_cloud_is_which_matters() -> None:
    source, target = torch.randn(2, 5, 16, generator=seeded(2))
    head = make()
    there = head(torch.cat([source, target], dim=-1))
    assert not torch.allclose(there, head(torch.cat([target, source], dim=-1)))
