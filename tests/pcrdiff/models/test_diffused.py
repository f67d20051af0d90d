"""From noise to a pose, and how one of several answers is chosen without the truth."""

import pytest
import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.rigid import pose_vector, transform
from pcrdiff.models.diffused import DiffusedMethod, best_fit, misfit
from pcrdiff.registration import Pairs
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs


def test_the_truth_fits_exact_copies_and_another_pose_does_not() -> None:
    pairs = synthetic_pairs(3, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    assert (misfit(transform(truth, pairs.source), pairs.target) < 1e-3).all()
    assert (misfit(pairs.source, pairs.target) > 0.02).all()


def test_what_only_one_cloud_shows_does_not_spoil_the_fit() -> None:
    cloud = synthetic_pairs(1, 200, generator=seeded(1)).source
    part = cloud[:, cloud[0, :, 0] > cloud[0, :, 0].quantile(0.4)]
    assert misfit(part, cloud).item() < 1e-6


def test_the_fit_is_the_same_either_way_round() -> None:
    a, b = torch.randn(2, 3, 50, 3, generator=seeded(2))
    torch.testing.assert_close(misfit(a, b), misfit(b, a))


def test_each_pair_gets_its_own_best_answer() -> None:
    pairs = synthetic_pairs(3, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    off = small_pose(20, (0.2, 0.0, 0.1)).float() @ truth
    answers = [off, truth.clone(), off.clone()]
    answers[0][2], answers[1][2] = truth[2], off[2]  # the third pair's best answer is the first
    torch.testing.assert_close(best_fit(answers, pairs.source, pairs.target), truth)


class ByTheStart(DiffusedMethod[None]):
    """Predicts the true pose, turned by the more the larger its noise is."""

    name = "by_the_start"

    def __init__(self, T: Tensor, walk: Walk) -> None:
        super().__init__(walk, "quaternion", "raw")
        self.T, self.errors, self.encoded = T, list[float](), 0

    def encode(self, source: Tensor, target: Tensor) -> None:
        """Nothing; it is counted."""
        self.encoded += 1

    def denoise(self, x_t: Tensor, t: Tensor, encoded: None) -> Tensor:
        """The pose vector."""
        angle = float(x_t[0, 0].abs()) * 30
        self.errors.append(angle)
        return pose_vector(small_pose(angle, (0.0, 0.0, 0.0)).float() @ self.T)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> dict[str, Tensor]:
        """Nothing to learn."""
        return {}


@pytest.mark.parametrize("hypotheses", [1, 8])
def test_of_several_walks_the_best_fitting_is_kept(hypotheses: int) -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    method = ByTheStart(truth, Walk(50, 1, "ddpm", hypotheses))
    answer = method.register(pairs.source, pairs.target, generator=seeded(3))
    assert (len(method.errors), method.encoded) == (hypotheses, 1)
    best = small_pose(min(method.errors), (0.0, 0.0, 0.0)).float() @ truth
    torch.testing.assert_close(answer, best)


def test_the_answer_is_the_pose_of_the_last_prediction() -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(0))
    truth = pairs.T_target_source.float()
    method = ByTheStart(truth, Walk(50, 3, "ddim"))
    answer = method.register(pairs.source, pairs.target, generator=seeded(6))
    last = small_pose(method.errors[2], (0.0, 0.0, 0.0)).float() @ truth
    torch.testing.assert_close(answer, last)


def test_another_walk_than_its_own_is_followed_from_what_is_encoded() -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(0))
    method = ByTheStart(pairs.T_target_source.float(), Walk(50, 1, "ddim"))
    clouds, longer = (pairs.source, pairs.target), Walk(50, 4, "ddim")
    answer = method.walk_back(None, *clouds, longer, generator=seeded(7))
    assert (len(method.errors), method.encoded) == (4, 0)
    twin = ByTheStart(pairs.T_target_source.float(), longer)
    torch.testing.assert_close(answer, twin.register(*clouds, generator=seeded(7)))


def test_training_corrupts_the_true_pose_to_a_time_of_the_schedule() -> None:
    pairs = synthetic_pairs(3, 20, generator=seeded(0))
    method = ByTheStart(pairs.T_target_source.float(), Walk(50, 1, "ddim"))
    x_0, x_t, t = method.corrupt(pairs, generator=seeded(8))
    torch.testing.assert_close(x_0, pose_vector(pairs.T_target_source).float())
    assert x_t.shape == (3, 7)
    assert not torch.allclose(x_t, x_0)
    assert ((t >= 1) & (t <= 50)).all()
