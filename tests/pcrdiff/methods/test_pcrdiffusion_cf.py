"""What is particular to the correspondence-free method."""

import pytest
import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk, sample
from pcrdiff.geometry.rigid import from_pose_vector, pose_vector, transform
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.models.losses import chamfer_loss, diffusion_loss, pose_loss
from tests.pcrdiff.methods.small_methods import make_cf
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs


class Told(PCRDiffusionCF):
    """Predicts what it was given, and remembers what it was asked."""

    def __init__(self, prediction: Tensor) -> None:
        walk = Walk(timesteps=20, steps=4, sampler="ddpm")
        super().__init__(walk, 8, "quaternion", "raw", "source", "with")
        self.prediction = prediction
        self.times: list[list[int]] = []

    def denoise(self, x_t: Tensor, t: Tensor, encoded: tuple[Tensor, Tensor]) -> Tensor:
        """The prediction."""
        del encoded
        self.times.append(t.tolist())
        assert x_t.shape == self.prediction.shape
        return self.prediction


def test_the_losses_are_those_of_equations_15_to_17() -> None:
    pairs = synthetic_pairs(3, 30, generator=seeded(0))
    truth = pose_vector(pairs.T_target_source).float()
    prediction = truth + 0.1 * torch.randn(3, 7, generator=seeded(1))
    terms = Told(prediction).loss(pairs, generator=seeded(2))
    T = from_pose_vector(prediction)
    torch.testing.assert_close(terms["diffusion"], diffusion_loss(prediction, truth))
    moved = transform(T, pairs.source)
    torch.testing.assert_close(terms["chamfer"], chamfer_loss(moved, pairs.target))
    torch.testing.assert_close(terms["pose"], pose_loss(T, pairs.T_target_source.float()))
    assert set(terms) == {"diffusion", "chamfer", "pose"}


def test_the_right_answer_has_no_loss() -> None:
    pairs = synthetic_pairs(3, 30, generator=seeded(0))
    terms = Told(pose_vector(pairs.T_target_source).float()).loss(pairs, generator=seeded(2))
    assert sum(terms.values()) < 1e-5


def test_denoises_once_a_step_of_the_walk() -> None:
    pairs = synthetic_pairs(2, 30, generator=seeded(0))
    method = Told(pose_vector(pairs.T_target_source).float())
    answer = method.register(pairs.source, pairs.target, generator=seeded(3))
    assert method.times == [[20, 20], [15, 15], [10, 10], [5, 5]]
    torch.testing.assert_close(answer, pairs.T_target_source.float())


@pytest.mark.parametrize("steps", [1, 5])
def test_encodes_each_cloud_once_whatever_the_steps(steps: int) -> None:
    method, encoded = make_cf(Walk(20, steps, "ddim")), list[Tensor]()
    method.encoder.register_forward_pre_hook(lambda _, inputs: encoded.append(inputs[0]))
    pairs = synthetic_pairs(2, 30, generator=seeded(0))
    method.register(pairs.source, pairs.target, generator=seeded(3))
    assert [
        points is cloud for points, cloud in zip(encoded, (pairs.source, pairs.target), strict=True)
    ]


def test_registering_is_algorithm_2_over_its_decoder() -> None:
    method, pairs = make_cf(), synthetic_pairs(2, 30, generator=seeded(0))
    with torch.no_grad():
        features = method.encoder(pairs.source), method.encoder(pairs.target)
        (vector,) = sample(
            lambda x_t, t: method.denoise(x_t, t, features), 2, 7, method.walk, generator=seeded(4)
        )
    answer = method.register(pairs.source, pairs.target, generator=seeded(4))
    torch.testing.assert_close(answer, from_pose_vector(vector))
