"""Every way to write a pose: there and back, any vector, and gradients that stay finite."""

import pytest
import torch
from scipy.linalg import logm
from scipy.spatial.transform import Rotation

from pcrdiff.geometry.representation import REPRESENTATIONS, RepresentationName
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, small_pose

NAMES = list(REPRESENTATIONS)
DIMS = {
    "quaternion": 7,
    "euler": 6,
    "rotation_6d": 9,
    "twist": 6,
    "dual_quaternion": 8,
    "matrix": 12,
}
ANGLES_DEG = (0.0, 1e-9, 1e-5, 0.05, 0.06, 1.0, 45.0, 90.0, 179.9, 179.9999)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("batch", [(), (1,), (3, 2)])
def test_a_pose_comes_back_in_any_batch(name: RepresentationName, batch: tuple[int, ...]) -> None:
    written, T = REPRESENTATIONS[name], random_poses(*batch, generator=seeded(0))
    vector = written.encode(T)
    assert vector.shape == (*batch, DIMS[name]) == (*batch, written.dim)
    torch.testing.assert_close(written.decode(vector), T, atol=1e-12, rtol=0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("angle", ANGLES_DEG)
def test_a_pose_near_no_turn_or_half_a_turn_comes_back(
    name: RepresentationName, angle: float
) -> None:
    written, T = REPRESENTATIONS[name], small_pose(angle, (0.1, -0.2, 0.7))
    torch.testing.assert_close(written.decode(written.encode(T)), T, atol=1e-9, rtol=0)


@pytest.mark.parametrize("name", NAMES)
def test_any_vector_stands_for_a_rigid_pose(name: RepresentationName) -> None:
    written = REPRESENTATIONS[name]
    T = written.decode(torch.randn(100, written.dim, generator=seeded(1), dtype=torch.float64))
    R = T[:, :3, :3]
    torch.testing.assert_close(R @ R.mT, torch.eye(3).double().expand_as(R), atol=1e-9, rtol=0)
    torch.testing.assert_close(torch.det(R), torch.ones(100).double(), atol=1e-9, rtol=0)
    assert (T[:, 3] == torch.tensor([0, 0, 0, 1])).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_tidy_vector_stands_for_the_same_pose_and_is_tidy(name: RepresentationName) -> None:
    written = REPRESENTATIONS[name]
    vector = torch.randn(50, written.dim, generator=seeded(2), dtype=torch.float64)
    tidy = written.tidy(vector)
    torch.testing.assert_close(written.decode(tidy), written.decode(vector))
    torch.testing.assert_close(written.tidy(tidy), tidy)
    T = random_poses(50, generator=seeded(3))
    torch.testing.assert_close(written.tidy(written.encode(T)), written.encode(T))


@pytest.mark.parametrize("name", NAMES)
def test_the_way_back_has_the_gradient_of_its_differences(name: RepresentationName) -> None:
    written = REPRESENTATIONS[name]
    vector = written.encode(random_poses(4, generator=seeded(4)))
    off = vector + 0.02 * torch.randn(vector.shape, generator=seeded(5), dtype=torch.float64)
    assert torch.autograd.gradcheck(written.decode, off.requires_grad_())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("angle", ANGLES_DEG[:-2])
def test_gradients_are_finite_there_and_back(name: RepresentationName, angle: float) -> None:
    written, T = REPRESENTATIONS[name], small_pose(angle, (0.1, -0.2, 0.7)).float()
    vector = written.encode(T.requires_grad_())
    (there,) = torch.autograd.grad(vector.square().sum(), T)
    start = vector.detach().requires_grad_()
    (back,) = torch.autograd.grad(written.decode(start)[:3].sum(), start)
    assert torch.isfinite(there).all()
    assert torch.isfinite(back).all()


@pytest.mark.parametrize("name", NAMES)
def test_the_identity_moves_nothing(name: RepresentationName) -> None:
    written = REPRESENTATIONS[name]
    assert torch.equal(written.decode(written.identity), torch.eye(4))


def test_the_twist_of_a_turn_is_scipys_rotation_vector() -> None:
    T = random_poses(20, generator=seeded(6))
    vector = REPRESENTATIONS["twist"].encode(T)
    ours = Rotation.from_matrix(T[:, :3, :3].numpy()).as_rotvec()
    torch.testing.assert_close(vector[:, :3], torch.from_numpy(ours))


def test_the_twist_is_the_matrix_logarithm() -> None:
    T = random_poses(1, generator=seeded(7))[0]
    shift = torch.from_numpy(logm(T.numpy()).real[:3, 3])
    twist = REPRESENTATIONS["twist"].encode(T)
    torch.testing.assert_close(twist[3:], shift, atol=1e-6, rtol=0)


def test_dual_quaternions_of_a_pure_shift_carry_half_of_it() -> None:
    vector = REPRESENTATIONS["dual_quaternion"].encode(small_pose(0.0, (1.0, 2.0, 3.0)))
    expected = torch.tensor([1, 0, 0, 0, 0, 0.5, 1.0, 1.5], dtype=torch.float64)
    torch.testing.assert_close(vector, expected)


def test_a_zero_quaternion_is_refused() -> None:
    for name in ("quaternion", "dual_quaternion"):
        with pytest.raises(ValueError, match="non-zero"):
            REPRESENTATIONS[name].decode(torch.zeros(1, DIMS[name]))
