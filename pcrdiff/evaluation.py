"""Running a method over pairs, one by one, and counting where it failed."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from pcrdiff.progress import Progress, silent
from pcrdiff.registration import Method, Pairs


@dataclass(frozen=True)
class Estimates:
    """A method's answers."""

    T_target_source: Float64[Tensor, "pairs 4 4"]
    """Where the method failed, the identity."""
    failures: tuple[str, ...]
    """Per pair why it failed, or nothing."""


def evaluate(method: Method, pairs: Pairs, *, seed: int, progress: Progress = silent) -> Estimates:
    """Register every pair by itself.

    Pair k draws from its own generator, seeded ``(seed, k)``, so that it is answered alike
    whatever was registered before it. A method that raises on a pair is scored as having left
    the source where it is, and the reason is kept.

    Raises:
        ValueError: The method wants given normals, and the pairs hold none.
    """
    source, target = pairs.clouds(getattr(method, "normals", "estimated"))
    poses, failures = [], []
    for k in progress(range(len(pairs)), method.name):
        try:
            pose = _register(method, (source[k : k + 1], target[k : k + 1]), k, seed)
            failure = ""
        except (ValueError, RuntimeError) as error:  # Open3D and LAPACK raise the latter
            pose, failure = torch.eye(4, dtype=torch.float64), _reason(error)
        poses.append(pose)
        failures.append(failure)
    return Estimates(torch.stack(poses), tuple(failures))


def _reason(error: Exception) -> str:
    """The first line of what it says; its kind where it says nothing."""
    return next(iter(str(error).splitlines()), "") or type(error).__name__


def _register(
    method: Method, pair: tuple[Tensor, Tensor], k: int, seed: int
) -> Float64[Tensor, "4 4"]:
    state = np.random.SeedSequence([seed, k]).generate_state(1, np.uint64)[0]
    generator = torch.Generator().manual_seed(int(state >> np.uint64(1)))
    pose = method.register(*pair, generator=generator)
    if not torch.isfinite(pose).all():
        raise ValueError(f"{method.name} answered with a pose that is not finite")
    return pose[0].double()
