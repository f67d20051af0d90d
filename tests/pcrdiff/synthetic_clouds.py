"""Clouds, poses and pairs that several tests share."""

import dataclasses
from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.geometry.rotation import matrix_from_quaternion
from pcrdiff.registration import Pairs


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def random_rotations(*batch: int, generator: torch.Generator) -> Tensor:
    """Uniform over SO(3), in float64."""
    quaternion = torch.randn(*batch, 4, generator=generator, dtype=torch.float64)
    return matrix_from_quaternion(quaternion)


def random_poses(*batch: int, generator: torch.Generator) -> Tensor:
    """Any rotation, and a translation of about one unit, in float64."""
    t = torch.randn(*batch, 3, generator=generator, dtype=torch.float64)
    return from_parts(random_rotations(*batch, generator=generator), t)


def small_pose(angle_deg: float, t: tuple[float, float, float]) -> Tensor:
    """A turn about the axis (1, 2, 2) / 3 and a shift, as ``[4 4]`` in float64."""
    half = torch.tensor(angle_deg / 2, dtype=torch.float64).deg2rad()
    axis = torch.tensor([1.0, 2.0, 2.0], dtype=torch.float64) / 3
    quaternion = torch.cat([half.cos().reshape(1), half.sin() * axis])
    return from_parts(matrix_from_quaternion(quaternion), torch.tensor(t, dtype=torch.float64))


def lopsided_clouds(batch: int, n: int, *, generator: torch.Generator) -> Tensor:
    """Points on smooth dented potatoes without any symmetry, about unit size, in float32."""
    u = torch.nn.functional.normalize(torch.randn(batch, n, 3, generator=generator), dim=-1)
    dents = 3 * torch.nn.functional.normalize(torch.randn(batch, 5, 3, generator=generator), dim=-1)
    depth = 0.1 + 0.2 * torch.rand(batch, 1, 5, generator=generator)
    radius = 0.8 + (depth * torch.cos(u @ dents.mT)).sum(dim=-1, keepdim=True)
    points: Tensor = u * radius * torch.tensor([0.9, 0.6, 0.4])
    return points


def synthetic_pairs(count: int, n: int, *, generator: torch.Generator) -> Pairs:
    """Exact copies in another order under turns of up to 45 degrees, one item each."""
    source = lopsided_clouds(count, n, generator=generator)
    turns = torch.linspace(5, 45, count).tolist()
    poses = torch.stack([small_pose(turn, (0.1, -0.2, turn / 90)) for turn in turns])
    target = transform(poses, source.double()).float()
    target = target[:, torch.randperm(n, generator=generator)]
    return Pairs(source, target, poses, torch.arange(count), ("potato",) * count)


def true_matches(pairs: Pairs) -> Tensor:
    """1 where the moved source point is the target point."""
    moved = transform(pairs.T_target_source, pairs.source.double())
    matches = (torch.cdist(moved, pairs.target.double()) < 1e-5).float()
    assert (matches.sum(dim=-1) == 1).all()
    return matches


def joined(blocks: Iterable[Pairs]) -> Pairs:
    """Pairs that came in blocks, as one."""
    each = list(blocks)
    fields: dict[str, Any] = {}
    for field in dataclasses.fields(Pairs):
        values = [getattr(block, field.name) for block in each]
        if field.name == "group":
            fields["group"] = tuple(name for names in values for name in names)
        else:
            fields[field.name] = None if values[0] is None else torch.cat(values)
    return Pairs(**fields)
