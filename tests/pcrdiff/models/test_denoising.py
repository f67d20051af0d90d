"""From noise to a pose, and how one of several answers is chosen without the truth."""

import pytest
import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.rigid import invert, pose_vector, transform
from pcrdiff.models.denoising import best_fit, misfit, walk_back
from pcrdiff.models.pose_space import PoseSpace
from tests.pcrdiff.made_up_clouds import made_up_pairs, random_poses, seeded, small_pose

QUATERNIONS = PoseSpace("quaternion", "raw")


def test_the_truth_fits_exact_copies_and_another_pose_does_not() -> None:
    pairs = made_up_pairs(3, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    assert (misfit(transform(truth, pairs.source), pairs.target) < 1e-3).all()
    assert (misfit(pairs.source, pairs.target) > 0.02).all()


def test_what_only_one_cloud_shows_does_not_spoil_the_fit() -> None:
    cloud = made_up_pairs(1, 200, generator=seeded(1)).source
    part = cloud[:, cloud[0, :, 0] > cloud[0, :, 0].quantile(0.4)]
    assert misfit(part, cloud).item() < 1e-6


def test_the_fit_is_the_same_either_way_round() -> None:
    a, b = torch.randn(2, 3, 50, 3, generator=seeded(2))
    torch.testing.assert_close(misfit(a, b), misfit(b, a))


def test_each_pair_gets_its_own_best_answer() -> None:
    pairs = made_up_pairs(3, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    off = small_pose(20, (0.2, 0.0, 0.1)).float() @ truth
    answers = [off, truth.clone(), off.clone()]
    answers[0][2], answers[1][2] = truth[2], off[2]  # the third pair's best answer is the first
    torch.testing.assert_close(best_fit(answers, pairs.source, pairs.target), truth)


class ByTheStart:
    """Answers with the true pose, turned by the more the larger its noise is."""

    def __init__(self, T: Tensor) -> None:
        self.T, self.errors = T, list[float]()

    def __call__(self, x_t: Tensor, t: Tensor) -> Tensor:
        """The pose vector."""
        del t
        angle = float(x_t[0, 0].abs()) * 30
        self.errors.append(angle)
        return pose_vector(small_pose(angle, (0.0, 0.0, 0.0)).float() @ self.T)


@pytest.mark.parametrize("hypotheses", [1, 8])
def test_of_several_walks_the_best_fitting_is_kept(hypotheses: int) -> None:
    pairs = made_up_pairs(1, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    denoise, walk = ByTheStart(truth), Walk(50, 1, "ddpm", hypotheses)
    answer = walk_back(denoise, pairs.source, pairs.target, QUATERNIONS, walk, generator=seeded(3))
    assert len(denoise.errors) == hypotheses
    best = small_pose(min(denoise.errors), (0.0, 0.0, 0.0)).float() @ truth
    torch.testing.assert_close(answer, best)


def test_the_answer_is_the_pose_of_the_last_prediction() -> None:
    T = random_poses(1, generator=seeded(4)).float()
    cloud = torch.randn(1, 30, 3, generator=seeded(5))
    answer = walk_back(
        lambda *_: pose_vector(T),
        cloud,
        cloud,
        QUATERNIONS,
        Walk(50, 3, "ddim"),
        generator=seeded(6),
    )
    torch.testing.assert_close(answer @ invert(T), torch.eye(4).unsqueeze(0), atol=1e-5, rtol=0)
