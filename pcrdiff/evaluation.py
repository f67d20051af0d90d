"""Running a method over pairs, one by one, and counting where it failed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.loops import Progress, Spread, in_turn, silent
from pcrdiff.registration import EVIDENCE, Method, Normals, Pairs, Source, Target

if TYPE_CHECKING:
    from pcrdiff.hypotheses import Verified


@dataclass(frozen=True)
class Estimates:
    """A method's answers."""

    T_target_source: Float64[Tensor, "pairs 4 4"]
    """Where the method failed, the identity."""
    failures: tuple[str, ...]
    """Per pair why it failed, or nothing."""
    evidence: Float64[Tensor, "pairs numbers"] | None = None
    """What speaks for each answer, as ``EVIDENCE`` names it; NaN where the method failed.

    None where it never says: see :class:`Verifying`.
    """


@runtime_checkable
class Verifying(Protocol):
    """A method that says what speaks for its answers, as ``VerifiedMethod`` of ``hypotheses``."""

    def verify(self, source: Source, target: Target, *, generator: torch.Generator) -> "Verified":
        """The answer to one pair, checked as ``register`` checks it, and what speaks for it."""


def evaluate(
    method: Method,
    pairs: Pairs,
    *,
    seed: int,
    progress: Progress = silent,
    spread: Spread = in_turn,
) -> Estimates:
    """Register every pair on its own.

    Pair k draws from its own generator, seeded ``(seed, k)``, so that it is answered alike
    whatever was registered before it, and wherever. A method that raises on a pair is scored as
    having left the source where it is, and the reason is kept.

    Raises:
        ValueError: The method wants given normals, and the pairs hold none.
    """
    (estimates,) = evaluate_all([Task(method, seed)], pairs, progress=progress, spread=spread)
    return estimates


@dataclass(frozen=True)
class Task:
    """A method that is to answer pairs, with the seed of its draws."""

    method: Method
    seed: int


def evaluate_all(
    tasks: Sequence[Task], pairs: Pairs, *, progress: Progress = silent, spread: Spread = in_turn
) -> list[Estimates]:
    """What :func:`evaluate` gives for each task: one pair after the other, under all of them.

    Raises:
        ValueError: A method wants given normals, and the pairs hold none.
    """
    clouds = {
        wanted: [cloud.numpy() for cloud in pairs.clouds(wanted)] for wanted in map(_normals, tasks)
    }
    numbers = range(len(pairs))
    items = (
        (k, {wanted: (p[k : k + 1], q[k : k + 1]) for wanted, (p, q) in clouds.items()})
        for k in numbers
    )
    answers = spread(partial(_answer, tasks), items)
    watched = progress(numbers, tasks[0].method.name)
    by_task = zip(*(found for _, found in zip(watched, answers, strict=True)), strict=True)
    return [_gather(task.method, found) for task, found in zip(tasks, by_task, strict=True)]


Answer = tuple[Float64[np.ndarray, "4 4"], str, Float64[np.ndarray, " numbers"]]
"""A pose, why there is none, and what speaks for it: NaN where nothing does."""
SILENT = np.full(len(EVIDENCE), np.nan)


def _normals(task: Task) -> Normals:
    return task.method.normals


def _answer(
    tasks: Sequence[Task], item: tuple[int, Mapping[Normals, Sequence[Float[np.ndarray, "1 n c"]]]]
) -> list[Answer]:
    """One pair under all tasks, which are shown the same tensors."""
    k, arrays = item
    clouds = {wanted: tuple(map(torch.from_numpy, pair)) for wanted, pair in arrays.items()}
    return [_answer_task(task, clouds[_normals(task)], k) for task in tasks]


def _answer_task(task: Task, pair: tuple[Tensor, ...], k: int) -> Answer:
    try:
        pose, evidence = _register(task, pair, k)
        return pose.numpy(), "", evidence
    except (ValueError, RuntimeError) as error:  # Open3D and LAPACK raise the latter
        return np.eye(4), _reason(error), SILENT


def _gather(method: Method, answers: Sequence[Answer]) -> Estimates:
    poses, failures, evidence = zip(*answers, strict=True)
    known = torch.from_numpy(np.stack(evidence)) if isinstance(method, Verifying) else None
    return Estimates(torch.from_numpy(np.stack(poses)), failures, known)


def _reason(error: Exception) -> str:
    """The first line of what it says; its kind where it says nothing."""
    return next(iter(str(error).splitlines()), "") or type(error).__name__


def _register(
    task: Task, pair: tuple[Tensor, ...], k: int
) -> tuple[Float64[Tensor, "4 4"], Float64[np.ndarray, " numbers"]]:
    state = np.random.SeedSequence([task.seed, k]).generate_state(1, np.uint64)[0]
    generator = torch.Generator().manual_seed(int(state >> np.uint64(1)))
    if isinstance(task.method, Verifying):
        source, target = pair
        found = task.method.verify(source[0], target[0], generator=generator)
        pose, evidence = found.T_target_source, found.evidence
    else:
        pose, evidence = task.method.register(*pair, generator=generator)[0], SILENT
    if not torch.isfinite(pose).all():
        raise ValueError(f"{task.method.name} answered with a pose that is not finite")
    return pose.double(), evidence
