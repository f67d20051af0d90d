"""The reverse loop (Algorithm 2) over any denoiser."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.process import ddim_step, q_posterior, time_pairs
from pcrdiff.diffusion.schedule import cosine_alphas_bar


@dataclass(frozen=True)
class Walk:
    """How the noise is laid on, and how it is walked back."""

    timesteps: int
    """T of the schedule."""
    steps: int
    """Of the walk from T to 0; training does not know of it."""
    sampler: Literal["ddpm", "ddim"]
    """``ddpm`` draws from the posterior, ``ddim`` walks without new noise."""
    hypotheses: int = 1
    """How many noises a walk starts from; ``pcrdiff.models.denoising`` keeps the answer that fits best."""


@runtime_checkable
class Denoiser(Protocol):
    """f_theta: predicts the clean vectors from noisy ones (Eq. 15)."""

    def __call__(
        self, x_t: Float[Tensor, "batch dim"], t: Int[Tensor, " batch"]
    ) -> Float[Tensor, "batch dim"]:
        """Predict ``x_0``."""
        ...


def sample(
    denoise: Denoiser, batch: int, dim: int, walk: Walk, *, generator: torch.Generator
) -> Float[Tensor, "hypotheses batch dim"]:
    """Walk from pure noise to clean vectors (Algorithm 2), once from each of several noises.

    Returns:
        The last prediction of x_0 of each walk.

    Raises:
        ValueError: Not ``1 <= steps <= timesteps``.
    """
    times = time_pairs(walk.timesteps, walk.steps)
    noise = draw_noise(batch, walk.hypotheses * walk.steps, dim, generator=generator)
    return torch.stack(
        [walk_from(each, denoise, times, walk) for each in torch.split(noise, walk.steps)]
    )


def walk_from(
    noise: Float[Tensor, "steps batch dim"],
    denoise: Denoiser,
    times: Sequence[tuple[int, int]],
    walk: Walk,
) -> Float[Tensor, "batch dim"]:
    """The walk that starts at the first noise; ``ddpm`` adds one of the others at each step."""
    alphas_bar = cosine_alphas_bar(walk.timesteps)
    x_t = x_0 = noise[0]
    for step, (t, s) in enumerate(times, start=1):
        x_0 = denoise(x_t, torch.full((x_t.shape[0],), t))
        if s == 0:
            break
        if walk.sampler == "ddim":
            x_t = ddim_step(x_0, x_t.to(x_0), t, s, alphas_bar)
        else:
            mean, deviation = q_posterior(x_0, x_t.to(x_0), t, s, alphas_bar)
            x_t = mean + deviation * noise[step].to(mean)
    return x_0


def draw_noise(
    batch: int, steps: int, dim: int, *, generator: torch.Generator
) -> Float[Tensor, "steps batch dim"]:
    """Standard normal noise, item by item: a batch draws what a loop over its items draws."""
    items = [torch.randn(steps, dim, generator=generator) for _ in range(batch)]
    return torch.stack(items, dim=1)
