"""New poses for the same pairs, drawn again in every epoch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from pcrdiff.geometry.random_pose import draw_pose
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.registration import Pairs


@dataclass(frozen=True)
class FreshPoses:
    """The range that a training pose is drawn from in each epoch; angles in radians."""

    max_rotation: float
    max_translation: float


def repose(pairs: Pairs, fresh: FreshPoses, generators: Sequence[np.random.Generator]) -> Pairs:
    """The same pairs under new poses: the target is moved from its old place to its new one."""
    poses = [draw_pose(fresh.max_rotation, fresh.max_translation, generator=g) for g in generators]
    T_new = torch.from_numpy(np.stack(poses))
    T_new_old = T_new @ invert(pairs.T_target_source)
    target = transform(T_new_old, pairs.target.double()).to(pairs.target)
    normals = pairs.target_normals
    if normals is not None:
        normals = (normals.double() @ T_new_old[:, :3, :3].mT).to(normals)
    return replace(pairs, target=target, T_target_source=T_new, target_normals=normals)
