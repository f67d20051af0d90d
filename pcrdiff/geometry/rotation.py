"""Rotations: matrices, unit quaternions (w, x, y, z) and Euler angles, in radians."""

import torch
from jaxtyping import Float
from torch import Tensor

Vectors3 = Float[Tensor, "*batch 3"]
Quaternions = Float[Tensor, "*batch 4"]
"""(w, x, y, z)."""
Rotations = Float[Tensor, "*batch 3 3"]


def matrix_from_quaternion(quaternion: Quaternions) -> Rotations:
    """Rotation matrix of a quaternion (w, x, y, z), which need not have unit length.

    Raises:
        ValueError: A quaternion is zero and so names no rotation.
    """
    norm = quaternion.norm(dim=-1, keepdim=True)
    if (norm == 0).any():
        raise ValueError("matrix_from_quaternion needs non-zero quaternions, got a zero one")
    w, x, y, z = (quaternion / norm).unbind(-1)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], dim=-1),
        torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], dim=-1),
        torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], dim=-1),
    ]
    return torch.stack(rows, dim=-2)


def quaternion_from_matrix(R: Rotations) -> Quaternions:
    """Unit quaternion (w, x, y, z) with w >= 0 of a rotation matrix.

    Each column of the 4x4 matrix below is the quaternion times one of its own components; the
    column of the largest component is the accurate one, also near 180 degrees (Shepperd 1978).
    """
    m = R.flatten(-2)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = m.unbind(-1)
    columns = torch.stack(
        [
            torch.stack([1 + r00 + r11 + r22, r21 - r12, r02 - r20, r10 - r01], dim=-1),
            torch.stack([r21 - r12, 1 + r00 - r11 - r22, r01 + r10, r02 + r20], dim=-1),
            torch.stack([r02 - r20, r01 + r10, 1 - r00 + r11 - r22, r12 + r21], dim=-1),
            torch.stack([r10 - r01, r02 + r20, r12 + r21, 1 - r00 - r11 + r22], dim=-1),
        ],
        dim=-2,
    )
    largest = columns.diagonal(dim1=-2, dim2=-1).argmax(dim=-1)
    index = largest[..., None, None].expand(*largest.shape, 1, 4)
    quaternion = columns.gather(-2, index).squeeze(-2)
    quaternion = quaternion / quaternion.norm(dim=-1, keepdim=True)
    return torch.where(quaternion[..., :1] < 0, -quaternion, quaternion)


def multiply_quaternions(a: Quaternions, b: Quaternions) -> Quaternions:
    """The product ``a b``: of two rotations, the one that turns by b first."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    parts = [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
    return torch.stack(parts, dim=-1)


def conjugate(quaternion: Quaternions) -> Quaternions:
    """``(w, -x, -y, -z)``: of a unit quaternion, the inverse."""
    return torch.cat([quaternion[..., :1], -quaternion[..., 1:]], dim=-1)


def matrix_from_euler(angles: Vectors3) -> Rotations:
    """``Rx(a) @ Ry(b) @ Rz(c)`` for ``angles = (a, b, c)``: how the field draws its rotations."""
    (sa, sb, sc), (ca, cb, cc) = angles.sin().unbind(-1), angles.cos().unbind(-1)
    rows = [
        torch.stack([cb * cc, -cb * sc, sb], dim=-1),
        torch.stack([ca * sc + sa * sb * cc, ca * cc - sa * sb * sc, -sa * cb], dim=-1),
        torch.stack([sa * sc - ca * sb * cc, sa * cc + ca * sb * sc, ca * cb], dim=-1),
    ]
    return torch.stack(rows, dim=-2)


def euler_from_matrix(R: Rotations) -> Vectors3:
    """Angles (a, b, c) with ``R = Rx(a) @ Ry(b) @ Rz(c)`` and b in [-pi/2, pi/2].

    Where ``b`` is a right angle only the sum or difference of a and c is known; c is then 0.
    """
    locked = torch.hypot(R[..., 0, 0], R[..., 0, 1]) < 1e-7  # cos b
    a = torch.where(
        locked, torch.atan2(R[..., 2, 1], R[..., 1, 1]), torch.atan2(-R[..., 1, 2], R[..., 2, 2])
    )
    b = torch.asin(R[..., 0, 2].clamp(-1, 1))
    c = torch.where(locked, 0.0, torch.atan2(-R[..., 0, 1], R[..., 0, 0]))
    return torch.stack([a, b, c], dim=-1)


def vee(M: Rotations) -> Vectors3:
    """``(M - M^T)`` as a vector: of a rotation by an angle about a unit axis, 2 sin(angle) axis."""
    skew = M - M.mT
    return torch.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], dim=-1)


def geodesic_angle(R_a: Rotations, R_b: Rotations) -> Float[Tensor, "*batch"]:
    """Angle in [0, pi] of the rotation ``R = R_a^T R_b`` between two rotations.

    ``atan2(|vee(R)|, trace(R) - 1)``, twice the sine and twice the cosine: equal to
    ``arccos((trace(R) - 1) / 2)``, which in float64 resolves no angle below 1e-8.
    """
    R = (R_a.unsqueeze(-1) * R_b.unsqueeze(-2)).sum(dim=-3)  # symmetric to the bit if R_a = R_b
    trace = R.diagonal(dim1=-2, dim2=-1).sum(dim=-1)
    return torch.atan2(vee(R).norm(dim=-1), trace - 1)


def angle_between(a: Vectors3, b: Vectors3) -> Float[Tensor, "*batch"]:
    """Angle in [0, pi], accurate everywhere; 0 where a vector vanishes."""
    (ax, ay, az), (bx, by, bz) = a.unbind(dim=-1), b.unbind(dim=-1)
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    cross = (x.square() + y.square() + z.square()).sqrt()
    dot = ax * bx + ay * by + az * bz + 0.0  # -0 becomes 0, for a vector that vanishes
    return torch.atan2(cross, dot)
