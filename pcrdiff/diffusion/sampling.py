"""The reverse process (Algorithm 2) over any denoiser."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.diffusion.process import Spacing, Times, Vectors, ddim_step, q_posterior, time_pairs
from pcrdiff.diffusion.schedule import cosine_alphas_bar


@dataclass(frozen=True)
class Walk:
    """Forward and reverse process settings."""

    timesteps: int
    """T of the schedule."""
    steps: int
    """Of the walk from T to 0; training does not depend on it."""
    sampler: Literal["ddpm", "ddim", "feedback"]
    """``ddpm`` draws from the posterior, ``ddim`` walks without new noise; with ``feedback`` the
    prediction of x_0 is itself the next x_t."""
    hypotheses: int = 1
    """Number of walks; ``pcrdiff.models.diffused`` keeps the best answer."""
    spacing: Spacing = "even"
    start: Literal["noise", "mode"] = "noise"
    """Where the first walk begins: in noise, or in the mode of the noise, which is zero. All
    others begin in noise."""


Denoiser = Callable[[Vectors, Times], Vectors]
"""f_theta: predicts the clean vectors x_0 from noisy ones and their time (Eq. 15)."""


def sample(
    denoise: Denoiser, batch: int, dim: int, walk: Walk, *, generator: torch.Generator
) -> Float[Tensor, "hypotheses batch dim"]:
    """Walk from noise to clean vectors (Algorithm 2), once for each hypothesis.

    Returns:
        The last prediction of x_0 of each walk.

    Raises:
        ValueError: Not ``1 <= steps <= timesteps``.
    """
    alphas_bar, found = cosine_alphas_bar(walk.timesteps), list[Tensor]()
    times = time_pairs(
        walk.timesteps, walk.steps, walk.spacing
    )  # time_pairs = list(zip(times[:-1], times[1:]))
    noise = draw_noise(batch, walk.hypotheses * walk.steps, dim, generator=generator)
    for eps in torch.split(noise, walk.steps):
        x_t = eps[0]  # G_t = normal(mean=0, std=1)
        if walk.start == "mode" and not found:
            x_t = torch.zeros_like(x_t)
        for step, (t, s) in enumerate(times, start=1):  # for t_now, t_next in time_pairs
            x_0 = denoise(x_t, torch.full((batch,), t))  # G_pred = decoder(encoder(G_t), t_now)
            if s == 0:
                found.append(x_0)  # return G_pred
            elif walk.sampler == "feedback":
                x_t = x_0
            elif walk.sampler == "ddim":
                x_t = ddim_step(x_0, x_t.to(x_0), t, s, alphas_bar)
            else:  # G_t = ddpm_step(G_t, G_pred, t_now, t_next)
                mean, deviation = q_posterior(x_0, x_t.to(x_0), t, s, alphas_bar)  # Eq. (10)
                x_t = mean + deviation * eps[step].to(mean)
    return torch.stack(found)


def draw_noise(
    batch: int, steps: int, dim: int, *, generator: torch.Generator
) -> Float[Tensor, "steps batch dim"]:
    """Standard normal noise, item by item: a batch draws what a loop over its items draws."""
    items = [torch.randn(steps, dim, generator=generator) for _ in range(batch)]
    return torch.stack(items, dim=1)
