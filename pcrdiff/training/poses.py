"""New poses for the same pairs, drawn again in every epoch."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from pcrdiff.geometry.random_pose import PoseRange, draw_pose
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.registration import Pairs


def repose(pairs: Pairs, fresh: PoseRange, generators: Sequence[np.random.Generator]) -> Pairs:
    """The same pairs under new poses: the target is moved from its old place to its new one."""
    poses = [draw_pose(fresh, generator=g) for g in generators]
    T_new = torch.from_numpy(np.stack(poses))
    T_new_old = T_new @ invert(pairs.T_target_source)
    target = transform(T_new_old, pairs.target.double()).to(pairs.target)
    normals = pairs.target_normals
    if normals is not None:
        normals = (normals.double() @ T_new_old[:, :3, :3].mT).to(normals)
    return replace(pairs, target=target, T_target_source=T_new, target_normals=normals)
