"""Twists ``(wx, wy, wz, vx, vy, vz)``: small rigid motions as vectors, in radians and lengths."""

import torch
from jaxtyping import Float
from torch import Tensor


def hat(w: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The matrix of the cross product: ``hat(w) @ x = w x x``."""
    x, y, z = w.unbind(-1)
    o = torch.zeros_like(x)
    rows = [torch.stack(row, dim=-1) for row in ([o, -z, y], [z, o, -x], [-y, x, o])]
    return torch.stack(rows, dim=-2)


def exp_twist(twist: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch 4 4"]:
    """The exponential from se(3) to SE(3): the motion after moving along a twist for one unit.

    Turns about ``w`` by its length; near zero it is ``x -> x + w x x + v``.
    """
    w, v = twist[..., :3], twist[..., 3:]
    upper = torch.cat([hat(w), v.unsqueeze(-1)], dim=-1)
    bottom = torch.zeros_like(upper[..., :1, :])
    T: Tensor = torch.linalg.matrix_exp(torch.cat([upper, bottom], dim=-2))
    return T
