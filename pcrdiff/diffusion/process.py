"""The Gaussian process over vectors: corrupting, and stepping back."""

from itertools import pairwise
from math import sqrt
from typing import Literal

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.schedule import AlphasBar
from pcrdiff.diffusion.shares import rows_drawn

Vectors = Float[Tensor, "batch entries"]
Times = Int[Tensor, " batch"]
Spacing = Literal["even", "quadratic"]


def q_sample(x_0: Vectors, t: Times, noise: Vectors, alphas_bar: AlphasBar) -> Vectors:
    """Corrupt clean vectors to time ``t`` (Eq. 6); at t = 0 nothing changes."""
    a = alphas_bar[t].unsqueeze(-1)
    return a.sqrt().to(x_0) * x_0 + (1 - a).sqrt().to(x_0) * noise


def corrupt(
    x_0: Vectors, alphas_bar: AlphasBar, *, generator: torch.Generator
) -> tuple[Vectors, Times]:
    """Draw a time in 1 .. T and a noise for each vector, and corrupt it (Algorithm 1).

    Where the generator shares a batch among processes, each vector gets the time and the noise
    that it would get in the whole batch.

    Returns:
        (x_t, t).
    """
    batch, mine = rows_drawn(len(x_0), generator)
    t = torch.randint(1, len(alphas_bar), (batch,), generator=generator)[mine]
    noise = torch.randn((batch, x_0.shape[1]), generator=generator)[mine].to(x_0)
    return q_sample(x_0, t, noise, alphas_bar), t.to(x_0.device)


def q_posterior(
    x_0: Vectors, x_t: Vectors, t: int, s: int, alphas_bar: AlphasBar
) -> tuple[Vectors, float]:
    """Mean and deviation of ``q(x_s | x_t, x_0)`` for any earlier time ``s < t`` (Eq. 10).

    With ``a = alphas_bar[t] / alphas_bar[s]``, the signal kept from s to t, this is the DDPM
    posterior (Ho et al. 2020, Eqs. 6-7) over the times that a short walk visits.

    Raises:
        ValueError: Not ``0 <= s < t``.
    """
    if not 0 <= s < t:
        raise ValueError(f"q_posterior needs 0 <= s < t, got s = {s}, t = {t}")
    a_t, a_s = alphas_bar[t].item(), alphas_bar[s].item()
    a = a_t / a_s
    mean = (sqrt(a_s) * (1 - a) * x_0 + sqrt(a) * (1 - a_s) * x_t) / (1 - a_t)
    return mean, sqrt((1 - a_s) * (1 - a) / (1 - a_t))


def ddim_step(x_0: Vectors, x_t: Vectors, t: int, s: int, alphas_bar: AlphasBar) -> Vectors:
    """Walk from ``t`` to an earlier ``s`` along the noise that ``x_t`` holds (Song et al. 2021)."""
    a_t, a_s = alphas_bar[t].item(), alphas_bar[s].item()
    noise = (x_t - sqrt(a_t) * x_0) / sqrt(1 - a_t)
    return sqrt(a_s) * x_0 + sqrt(1 - a_s) * noise


def time_pairs(timesteps: int, steps: int, spacing: Spacing = "even") -> list[tuple[int, int]]:
    """The pairs (t, s) of ``steps`` steps from ``timesteps`` down to 0 (Algorithm 2).

    Quadratic times crowd towards 0, where little noise is left: the last of four even steps ends
    a quarter of the way from there.

    Raises:
        ValueError: Not ``1 <= steps <= timesteps``.
    """
    if not 1 <= steps <= timesteps:
        raise ValueError(f"time_pairs needs 1 <= steps <= {timesteps}, got {steps}")
    share = torch.linspace(1, 0, steps + 1, dtype=torch.float64)
    spaced = timesteps * (share if spacing == "even" else share.square())
    least = torch.arange(steps, -1, -1)  # no time twice
    return list(pairwise(torch.maximum(spaced.round().int(), least).tolist()))
