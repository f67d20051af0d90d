"""What is particular to RPM-Net: unit features of pairs that motion leaves as they are."""

import torch

from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.rpmnet import RPMNet
from pcrdiff.models.structure import move
from tests.pcrdiff.methods.small_methods import make_matching
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded


def test_features_have_unit_length_and_see_a_motion_in_the_descriptors() -> None:
    method, cloud = make_matching(RPMNet), lopsided_clouds(2, 40, generator=seeded(0))
    described = method.describe(cloud, None)
    features = method.embed(described)
    torch.testing.assert_close(features.norm(dim=-1), torch.ones(2, 40))
    turned = method.embed(move(described, random_poses(2, generator=seeded(1)).float()))
    assert not torch.allclose(turned, features, atol=1e-3)


def test_pair_features_of_estimated_normals_do_not_change_when_the_cloud_moves() -> None:
    method, cloud = make_matching(RPMNet), lopsided_clouds(2, 40, generator=seeded(0)).double()
    moved = transform(random_poses(2, generator=seeded(1)), cloud)
    before, after = (method.describe(each, None)[..., 6:] for each in (cloud, moved))
    torch.testing.assert_close(after, before, atol=1e-6, rtol=0)
