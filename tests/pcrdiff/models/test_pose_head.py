"""Two features to a pose vector."""

import torch

from pcrdiff.models.pose_head import PoseHead
from tests.pcrdiff.made_up_clouds import seeded


def make() -> PoseHead:
    torch.manual_seed(0)
    return PoseHead(dim=32, widths=(24, 12))


def test_any_two_features_give_a_unit_quaternion_and_a_translation() -> None:
    source, target = 10 * torch.randn(2, 50, 16, generator=seeded(0))
    vector = make()(source, target)
    assert vector.shape == (50, 7)
    torch.testing.assert_close(vector[:, :4].norm(dim=-1), torch.ones(50))
    assert vector[:, 4:].std() > 0


def test_an_answer_of_nothing_is_the_identity() -> None:
    head = make()
    torch.nn.init.zeros_(head.layers[-1].get_parameter("weight"))
    torch.nn.init.zeros_(head.layers[-1].get_parameter("bias"))
    source, target = torch.randn(2, 5, 16, generator=seeded(1))
    identity = torch.tensor([1.0, 0, 0, 0, 0, 0, 0]).expand(5, 7)
    torch.testing.assert_close(head(source, target), identity)


def test_which_cloud_is_which_matters() -> None:
    source, target = torch.randn(2, 5, 16, generator=seeded(2))
    head = make()
    assert not torch.allclose(head(source, target), head(target, source))
