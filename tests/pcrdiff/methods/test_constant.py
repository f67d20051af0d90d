"""The mean training pose."""

import torch
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.rigid import from_parts
from pcrdiff.methods.constant import Constant
from tests.pcrdiff.synthetic_clouds import lopsided_clouds, random_poses, seeded, small_pose


def answer(T_training: torch.Tensor, seed: int = 0) -> torch.Tensor:
    clouds = lopsided_clouds(2, 20, generator=seeded(seed)).double()
    return Constant(T_training).register(clouds[:1], clouds[1:], generator=seeded(0))[0]


def test_of_one_pose_is_that_pose_whatever_the_clouds_are() -> None:
    T = random_poses(1, generator=seeded(1))
    for seed in range(3):
        torch.testing.assert_close(answer(T, seed), T[0])


def test_halfway_between_two_turns_about_one_axis() -> None:
    poses = torch.stack([small_pose(10, (1.0, 0, 0)), small_pose(50, (0, 3.0, 0))])
    torch.testing.assert_close(answer(poses), small_pose(30, (0.5, 1.5, 0)))


def test_is_scipys_mean_rotation() -> None:
    poses = random_poses(20, generator=seeded(2))
    mean = Rotation.from_matrix(poses[:, :3, :3].numpy()).mean().as_matrix()
    torch.testing.assert_close(answer(poses)[:3, :3], torch.from_numpy(mean))


def test_is_a_rotation_also_where_the_mean_is_nearer_to_a_reflection() -> None:
    half_turns = [
        torch.diag(torch.tensor(d)) for d in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])
    ]
    R = torch.stack(half_turns).double()  # their mean is -I / 3
    T = answer(from_parts(R, torch.zeros(3, 3, dtype=torch.float64)))
    assert torch.isclose(torch.det(T[:3, :3]), torch.ones((), dtype=torch.float64))


def test_no_rotation_nearby_is_nearer_to_the_training_poses() -> None:
    poses = random_poses(7, generator=seeded(3))
    best = answer(poses)

    def cost(T: torch.Tensor) -> torch.Tensor:
        return (poses[:, :3, :3] - T[:3, :3]).square().sum()

    for seed in range(10):
        axis = random_poses(1, generator=seeded(seed))[0]
        nudge = axis @ small_pose(1.0, (0, 0, 0)) @ axis.inverse()
        assert cost(nudge @ best) > cost(best)
