"""F_t, the feature of the noisy pose and its time, and where it joins those of the clouds."""

import math
from itertools import chain, pairwise
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcrdiff.diffusion.process import Times, Vectors

TIME_DIM = 128
Diffusion = Literal["with", "without"]
Fusion = Literal["source", "target", "concat"]
FEATURES: dict[Fusion, int] = {"source": 2, "target": 2, "concat": 3}
"""The width of the fused feature, in features."""


class PoseEncoder(nn.Module):
    """Encodes a noisy pose vector and its time into one feature (Sec. 3.4, Algorithm 1).

    The paper names a "transformation encoder" and passes ``t`` to the decoder without saying
    how; here an MLP encodes the pose, and a sinusoidal embedding of ``t`` through another MLP
    (Nichol & Dhariwal 2021) is added to it. The last layers start at zero, so training starts
    from the network without diffusion.
    """

    def __init__(self, pose_dim: int, dim: int) -> None:
        """``dim`` is the width of the features that F_t is added to."""
        super().__init__()
        hidden = [(nn.Linear(i, o), nn.ReLU()) for i, o in pairwise((pose_dim, 64, 128, 256))]
        self.pose = nn.Sequential(*chain(*hidden), nn.Linear(256, dim))
        self.time = nn.Sequential(nn.Linear(TIME_DIM, dim), nn.SiLU(), nn.Linear(dim, dim))
        for last in (self.pose[-1], self.time[-1]):
            nn.init.zeros_(last.get_parameter("weight"))
            nn.init.zeros_(last.get_parameter("bias"))

    def forward(self, x_t: Vectors, t: Times) -> Float[Tensor, "batch dim"]:
        """F_t, one row per pair."""
        encoded: Tensor = self.pose(x_t) + self.time(time_embedding(t, TIME_DIM).to(x_t))
        return encoded


class NoPoseEncoder(nn.Module):
    """Table 3's "without diffusion": the decoder is not given the noisy pose."""

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.dim = dim

    def forward(self, x_t: Vectors, t: Times) -> Float[Tensor, "batch dim"]:
        """Zeros, whatever the pose."""
        del t
        return x_t.new_zeros(len(x_t), self.dim)


def make_pose_encoder(diffusion: Diffusion, pose_dim: int, dim: int) -> nn.Module:
    """The encoder of a noisy pose of ``pose_dim`` entries, or its substitute without diffusion."""
    return PoseEncoder(pose_dim, dim) if diffusion == "with" else NoPoseEncoder(dim)


def time_embedding(t: Times, dim: int) -> Float[Tensor, "batch dim"]:
    """Sines and cosines of ``t`` at ``dim / 2`` frequencies from 1 down to 1e-4."""
    exponents = torch.arange(dim // 2, device=t.device) / (dim // 2)
    angles = t.unsqueeze(-1) * torch.exp(-math.log(10_000) * exponents)
    return torch.cat([angles.sin(), angles.cos()], dim=-1)


def fuse(
    fusion: Fusion,
    pose: Float[Tensor, "batch dim"],
    source: Float[Tensor, "batch dim"],
    target: Float[Tensor, "batch dim"],
) -> Float[Tensor, "batch wide"]:
    """F_t added to F_P or to F_Q before they are concatenated, or all three concatenated (Table 5)."""
    if fusion == "source":
        return torch.cat([source + pose, target], dim=-1)
    if fusion == "target":
        return torch.cat([source, target + pose], dim=-1)
    return torch.cat([source, target, pose], dim=-1)
