"""Noise schedules. Time runs t = 0 .. T as in the paper: 0 is clean, T is noise."""

import math

import torch
from jaxtyping import Float64
from torch import Tensor

AlphasBar = Float64[Tensor, " times"]
"""The share of the signal's power that is left at each time 0 .. T."""


def cosine_alphas_bar(timesteps: int, max_beta: float = 0.999) -> AlphasBar:
    """Cumulative signal power of the cosine schedule (Nichol & Dhariwal 2021, Eq. 17).

    Args:
        timesteps: T; the result has T + 1 entries, the first of them 1.
        max_beta: Cap on a single step's variance, which keeps t = T from being singular.

    Raises:
        ValueError: ``timesteps`` is below 1.
    """
    if timesteps < 1:
        raise ValueError(f"cosine_alphas_bar needs timesteps >= 1, got {timesteps}")
    u = torch.linspace(0, 1, timesteps + 1, dtype=torch.float64)
    f = torch.cos((u + 0.008) / 1.008 * math.pi / 2).square()
    betas = (1 - f[1:] / f[:-1]).clamp(max=max_beta)
    return torch.cat([torch.ones_like(betas[:1]), torch.cumprod(1 - betas, dim=0)])
