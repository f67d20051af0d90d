"""Twists ``(wx, wy, wz, vx, vy, vz)``: small rigid motions as vectors, in radians and lengths."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.rigid import Transforms
from pcrdiff.geometry.rotation import Rotations, Vectors3, quaternion_from_matrix

SMALL = 1e-3  # radians; below it the series is as exact as the formula


def hat(w: Vectors3) -> Rotations:
    """The matrix of the cross product: ``hat(w) @ x = w x x``."""
    x, y, z = w.unbind(-1)
    o = torch.zeros_like(x)
    rows = [torch.stack(row, dim=-1) for row in ([o, -z, y], [z, o, -x], [-y, x, o])]
    return torch.stack(rows, dim=-2)


def exp_twist(twist: Float[Tensor, "*batch 6"]) -> Transforms:
    """The exponential from se(3) to SE(3): the motion after moving along a twist for one unit.

    Turns about ``w`` by its length; near zero it is ``x -> x + w x x + v``.
    """
    w, v = twist[..., :3], twist[..., 3:]
    upper = torch.cat([hat(w), v.unsqueeze(-1)], dim=-1)
    bottom = torch.zeros_like(upper[..., :1, :])
    T: Tensor = torch.linalg.matrix_exp(torch.cat([upper, bottom], dim=-2))
    return T


def log_twist(T: Transforms) -> Float[Tensor, "*batch 6"]:
    """Inverse of :func:`exp_twist` for turns of at most pi."""
    quaternion = quaternion_from_matrix(T[..., :3, :3])
    sine = quaternion[..., 1:].square().sum(dim=-1, keepdim=True)
    tiny = sine < (SMALL / 2) ** 2
    length = torch.where(tiny, torch.ones_like(sine), sine).sqrt()  # mask before the root
    cosine = quaternion[..., :1]
    w = quaternion[..., 1:] * torch.where(
        tiny, 2 / cosine.clamp(min=0.5), 2 * torch.atan2(length, cosine) / length
    )
    t = T[..., :3, 3]
    across = torch.linalg.cross(w, t)
    bent = _bend(w.square().sum(dim=-1, keepdim=True)) * torch.linalg.cross(w, across)
    return torch.cat([w, t - 0.5 * across + bent], dim=-1)


def _bend(squared_angle: Float[Tensor, "*batch 1"]) -> Float[Tensor, "*batch 1"]:
    """``(1 - (a / 2) cot(a / 2)) / a^2``, the second coefficient of the inverse of V."""
    tiny = squared_angle < SMALL**2
    squares = torch.where(tiny, torch.ones_like(squared_angle), squared_angle)
    half = squares.sqrt() / 2
    exact = (1 - half / torch.tan(half)) / squares
    return torch.where(tiny, 1 / 12 + squared_angle / 720, exact)
