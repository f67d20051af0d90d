"""The reverse loop: what it asks of a denoiser, and where a perfect one leads it."""

from typing import Literal

import pytest
import torch
from torch import Tensor

from pcrdiff.diffusion.process import time_pairs
from pcrdiff.diffusion.sampling import Denoiser, Walk, draw_noise, sample
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from tests.pcrdiff.synthetic_clouds import seeded

Sampler = Literal["ddpm", "ddim", "feedback"]
SAMPLERS: list[Sampler] = ["ddpm", "ddim", "feedback"]


class Perfect:
    """Knows the answer, and remembers what it was asked."""

    def __init__(self, x_0: Tensor) -> None:
        self.x_0 = x_0
        self.asked: list[Tensor] = []
        self.times: list[int] = []

    def __call__(self, x_t: Tensor, t: Tensor) -> Tensor:
        """The answer."""
        assert t.shape == (len(x_t),)
        assert (t == t[0]).all()
        self.asked.append(x_t)
        self.times.append(int(t[0]))
        return self.x_0


def shrink(x_t: Tensor, t: Tensor) -> Tensor:
    """A denoiser whose answer depends on all that it is given."""
    return 0.3 * x_t.tanh() + 0.001 * t.unsqueeze(-1)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("steps", [1, 2, 5, 20])
def test_a_perfect_denoiser_is_believed(steps: int, sampler: Sampler) -> None:
    x_0 = torch.randn(3, 7, generator=seeded(0))
    walk = Walk(timesteps=20, steps=steps, sampler=sampler)
    assert torch.equal(sample(Perfect(x_0), 3, 7, walk, generator=seeded(1))[0], x_0)


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("steps", [1, 3, 10])
def test_the_denoiser_is_asked_once_a_step_at_the_times_of_the_walk(
    steps: int, sampler: Sampler
) -> None:
    denoise = Perfect(torch.zeros(2, 7))
    sample(denoise, 2, 7, Walk(1000, steps, sampler), generator=seeded(2))
    assert denoise.times == [t for t, _ in time_pairs(1000, steps)]


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_batch_is_a_loop_over_its_items(sampler: Sampler) -> None:
    walk = Walk(timesteps=50, steps=4, sampler=sampler)
    (batch,) = sample(shrink, 5, 7, walk, generator=seeded(3))
    one_generator = seeded(3)
    loop = [sample(shrink, 1, 7, walk, generator=one_generator)[0] for _ in range(5)]
    torch.testing.assert_close(batch, torch.cat(loop))


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_seed_decides(sampler: Sampler) -> None:
    walk = Walk(timesteps=50, steps=4, sampler=sampler)
    first, second, other = (sample(shrink, 2, 7, walk, generator=seeded(k))[0] for k in (4, 4, 5))
    assert torch.equal(first, second)
    assert not torch.allclose(first, other)


def test_ddim_walks_from_the_same_noise_without_drawing_more() -> None:
    x_0 = torch.full((2, 7), 2.0)
    denoise = Perfect(x_0)
    sample(denoise, 2, 7, Walk(30, 3, "ddim"), generator=seeded(6))
    a = cosine_alphas_bar(30)[denoise.times].float()
    noise = [
        (x - s * x_0) / n for x, s, n in zip(denoise.asked, a.sqrt(), (1 - a).sqrt(), strict=True)
    ]
    torch.testing.assert_close(noise[1], noise[0], atol=1e-3, rtol=0)
    torch.testing.assert_close(noise[2], noise[0], atol=1e-3, rtol=0)


@pytest.mark.parametrize("sampler", ["ddpm", "ddim"])
def test_walking_with_a_perfect_denoiser_visits_the_process_itself(sampler: Sampler) -> None:
    count, x_0 = 20_000, torch.tensor([[3.0, -1.0]])
    denoise = Perfect(x_0.repeat(count, 1))
    sample(denoise, count, 2, Walk(40, 5, sampler), generator=seeded(7))
    for x_s, s in zip(denoise.asked[1:], denoise.times[1:], strict=True):
        a = cosine_alphas_bar(40)[s].item()  # q(x_s | x_0), Eq. 6
        tolerance = 5 / count**0.5
        torch.testing.assert_close(x_s.mean(dim=0), a**0.5 * x_0[0], atol=tolerance, rtol=0)
        torch.testing.assert_close(x_s.var(dim=0), (1 - a) * torch.ones(2), atol=tolerance, rtol=0)


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_walk_follows_the_device_of_the_denoiser(sampler: Sampler) -> None:
    def elsewhere(x_t: Tensor, t: Tensor) -> Tensor:
        del t
        return x_t.to("meta")

    (answer,) = sample(elsewhere, 2, 7, Walk(10, 3, sampler), generator=seeded(8))
    assert answer.device.type == "meta"


def test_noise_is_standard_normal_and_every_item_has_its_own() -> None:
    noise = draw_noise(200, 3, 50, generator=seeded(9))
    assert noise.shape == (3, 200, 50)
    assert noise.mean().item() == pytest.approx(0, abs=0.03)
    assert noise.std().item() == pytest.approx(1, abs=0.03)
    assert len(torch.unique(noise[:, :, 0])) == 600


@pytest.mark.parametrize("steps", [0, 11])
def test_refuses_a_walk_without_steps_or_with_more_than_times(steps: int) -> None:
    denoise: Denoiser = Perfect(torch.zeros(1, 7))
    with pytest.raises(ValueError, match=f"1 <= steps <= 10, got {steps}"):
        sample(denoise, 1, 7, Walk(10, steps, "ddim"), generator=seeded(10))


def test_hypotheses_are_walks_from_noises_of_their_own() -> None:
    walk = Walk(timesteps=30, steps=3, sampler="ddpm", hypotheses=4)
    answers = sample(shrink, 5, 7, walk, generator=seeded(11))
    assert answers.shape == (4, 5, 7)
    assert len({tuple(answer.flatten().tolist()) for answer in answers}) == 4
    one_by_one = seeded(11)
    loop = [sample(shrink, 1, 7, walk, generator=one_by_one) for _ in range(5)]
    torch.testing.assert_close(answers, torch.cat(loop, dim=1))


def test_feedback_asks_about_its_own_answers() -> None:
    answers = list[Tensor]()

    def denoise(x_t: Tensor, t: Tensor) -> Tensor:
        if answers:
            assert torch.equal(x_t, answers[-1])
        answers.append(shrink(x_t, t))
        return answers[-1]

    sample(denoise, 2, 7, Walk(1000, 4, "feedback"), generator=seeded(2))
    assert len(answers) == 4


def test_from_the_mode_only_the_first_walk_begins_without_noise() -> None:
    denoise = Perfect(torch.zeros(2, 7))
    walk = Walk(1000, 1, "feedback", hypotheses=3, start="mode")
    sample(denoise, 2, 7, walk, generator=seeded(2))
    assert [bool((x_t == 0).all()) for x_t in denoise.asked] == [True, False, False]


def test_quadratic_walks_visit_quadratic_times() -> None:
    denoise = Perfect(torch.zeros(2, 7))
    sample(denoise, 2, 7, Walk(1000, 4, "ddpm", spacing="quadratic"), generator=seeded(2))
    assert denoise.times == [t for t, _ in time_pairs(1000, 4, "quadratic")]
