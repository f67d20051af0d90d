"""What is particular to DCP's first version."""

import torch
from torch import Tensor, nn

from pcrdiff.methods.dcp_v1 import DCPv1
from pcrdiff.models.pointers import fit_pointers
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


def make() -> DCPv1:
    torch.manual_seed(0)
    return DCPv1(feature_dim=32, neighbours=6)


class Known(nn.Module):
    """An encoder that labels every point of the source and its copy in the target."""

    def __init__(self, source: Tensor, target: Tensor, order: Tensor) -> None:
        super().__init__()
        self.clouds = (source, target)
        self.labels = 30 * torch.eye(len(order)), 30 * torch.eye(len(order))[order]

    def forward(self, points: Tensor) -> Tensor:
        """A label per point, the same for a point and its copy."""
        which = 0 if points is self.clouds[0] else 1
        return self.labels[which].expand(len(points), -1, -1)


def test_features_that_tell_every_point_from_the_others_give_the_exact_pose() -> None:
    pairs = synthetic_pairs(3, 40, generator=seeded(0))
    gaps = torch.cdist(
        pairs.source @ pairs.T_target_source[:, :3, :3].float().mT
        + pairs.T_target_source[:, None, :3, 3].float(),
        pairs.target,
    )
    order = gaps[0].argmin(dim=0)  # target j is a copy of source order[j], in all pairs
    method = make()
    method.encoder = Known(pairs.source, pairs.target, order)  # type: ignore[assignment]
    answer = method.register(pairs.source, pairs.target, generator=seeded(0))
    torch.testing.assert_close(answer, pairs.T_target_source.float(), atol=1e-5, rtol=0)
    assert sum(method.loss(pairs, generator=seeded(0)).values()) < 1e-9


def test_registering_points_with_the_features_of_each_cloud_on_its_own() -> None:
    method, pairs = make(), synthetic_pairs(2, 30, generator=seeded(1))
    answer = method.register(pairs.source, pairs.target, generator=seeded(0))
    features = method.encoder(pairs.source), method.encoder(pairs.target)
    torch.testing.assert_close(answer, fit_pointers(pairs.source, pairs.target, *features))
