"""Trimmed ICP from the shift between the centroids."""

import torch

from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.icp_centroid import ICPCentroid
from pcrdiff.methods.trimmed_icp import TrimmedICP
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs

METHOD = TrimmedICP(max_iterations=100)


def test_finds_the_share_that_overlaps_where_icp_is_pulled_away() -> None:
    pairs = synthetic_pairs(3, 400, generator=seeded(4))
    target = pairs.source.double()
    order = target[..., 0].argsort(dim=-1)[:, 100:]  # a quarter is cut off at one end
    target = target.gather(1, order[..., None].expand(-1, -1, 3))
    T = small_pose(5, (0.0, 0.0, 0.0)).expand(3, 4, 4)
    source, target = pairs.source.double(), transform(T, target)
    trimmed = METHOD.register(source, target, generator=seeded(0))
    plain = ICPCentroid(100, 0.5).register(source, target, generator=seeded(0))
    assert error_r_deg(trimmed, T).max() < 0.01
    assert error_r_deg(plain, T).min() > 0.5


def test_draws_nothing() -> None:
    pairs = synthetic_pairs(1, 100, generator=seeded(5))
    first, second = (
        METHOD.register(pairs.source, pairs.target, generator=seeded(k)) for k in (0, 1)
    )
    assert torch.equal(first, second)
