"""Evaluation: every pair by itself, and every failure counted."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.evaluation import Task, evaluate, evaluate_all
from pcrdiff.hypotheses import Refinement, Starts, VerifiedMethod
from pcrdiff.registration import EVIDENCE, Method, Normals, Pairs, Source, Target
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, synthetic_pairs

T = TypeVar("T")


class Guess(Method):
    """Answers a random pose; on the pairs of ``trouble`` it does what is said there."""

    name = "guess"

    def __init__(self, trouble: dict[int, Exception | float] | None = None) -> None:
        self.trouble, self.asked = trouble or {}, 0

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """As :class:`Method` asks."""
        assert len(source) == len(target) == 1
        k, self.asked = self.asked, self.asked + 1
        trouble = self.trouble.get(k)
        if isinstance(trouble, Exception):
            raise trouble
        pose = random_poses(1, generator=generator)
        return pose if trouble is None else pose * trouble


def five_pairs() -> Pairs:
    return synthetic_pairs(5, 12, generator=seeded(0))


def test_a_method_that_raises_on_pair_3_is_counted_and_scored_as_the_identity() -> None:
    healthy = evaluate(Guess(), five_pairs(), seed=1)
    failing = evaluate(Guess({3: ValueError("no idea\nat all")}), five_pairs(), seed=1)
    assert failing.failures == ("", "", "", "no idea", "")
    assert torch.equal(failing.T_target_source[3], torch.eye(4, dtype=torch.float64))
    others = [0, 1, 2, 4]
    assert torch.equal(failing.T_target_source[others], healthy.T_target_source[others])
    assert healthy.failures == ("",) * 5


@pytest.mark.parametrize("error", [RuntimeError("from Open3D"), np.linalg.LinAlgError("svd")])
def test_what_open3d_and_lapack_raise_is_a_failure_too(error: Exception) -> None:
    assert evaluate(Guess({0: error}), five_pairs(), seed=1).failures[0] == str(error)


def test_a_failure_without_words_is_still_a_failure() -> None:
    estimates = evaluate(
        Guess({2: ValueError(), 4: RuntimeError("\nsaid late")}), five_pairs(), seed=1
    )
    assert estimates.failures == ("", "", "ValueError", "", "RuntimeError")


@pytest.mark.parametrize("factor", [torch.nan, torch.inf])
def test_a_pose_that_is_not_finite_is_a_failure(factor: float) -> None:
    estimates = evaluate(Guess({1: factor}), five_pairs(), seed=1)
    assert "guess answered with a pose that is not finite" in estimates.failures[1]
    assert torch.equal(estimates.T_target_source[1], torch.eye(4, dtype=torch.float64))


def test_a_programming_error_is_not_a_failure() -> None:
    with pytest.raises(KeyError):
        evaluate(Guess({0: KeyError("typo")}), five_pairs(), seed=1)


def test_a_pair_is_answered_alike_whatever_was_registered_before_it() -> None:
    pairs = five_pairs()
    whole = evaluate(Guess(), pairs, seed=1).T_target_source
    start = evaluate(Guess(), pairs.select(torch.arange(2)), seed=1).T_target_source
    other_before = evaluate(Guess(), pairs.select(torch.tensor([4, 4, 2])), seed=1).T_target_source
    failed_before = evaluate(Guess({0: ValueError("no")}), pairs, seed=1).T_target_source
    assert torch.equal(start, whole[:2])
    assert torch.equal(other_before[2], whole[2])
    assert torch.equal(failed_before[1:], whole[1:])


def test_the_seed_and_the_pair_decide_what_is_drawn() -> None:
    first, again, other = (
        evaluate(Guess(), five_pairs(), seed=k).T_target_source for k in (1, 1, 2)
    )
    assert torch.equal(first, again)
    assert (first != other).flatten(1).any(dim=1).all()
    assert len(torch.unique(first.flatten(1), dim=0)) == 5


def test_progress_is_told_of_every_pair() -> None:
    told: list[tuple[list[object], str]] = []

    def watch(items: Sequence[T], description: str) -> Iterable[T]:
        told.append((list(items), description))
        return items

    evaluate(Guess(), five_pairs(), seed=1, progress=watch)
    assert told == [([0, 1, 2, 3, 4], "guess")]


class Watching(Guess):
    """Remembers how many channels its clouds had."""

    def __init__(self, normals: Normals) -> None:
        super().__init__()
        self.normals, self.channels = normals, set[int]()

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """As :class:`Method` asks."""
        self.channels |= {source.shape[-1], target.shape[-1]}
        return super().answer(source, target, generator=generator)


@pytest.mark.parametrize(("normals", "channels"), [("given", 6), ("estimated", 3)])
def test_a_method_is_shown_the_normals_that_it_wants(normals: Normals, channels: int) -> None:
    pairs = five_pairs()
    pairs = replace(pairs, source_normals=pairs.source, target_normals=pairs.target)
    method = Watching(normals)
    assert evaluate(method, pairs, seed=1).failures == ("",) * 5
    assert method.channels == {channels}


def test_pairs_without_the_normals_a_method_wants_are_refused_and_no_failure_of_its() -> None:
    with pytest.raises(ValueError, match="the pairs hold no normals"):
        evaluate(Watching("given"), five_pairs(), seed=1)


class Truthful(VerifiedMethod):
    """Starts from the identity and a turn that its generator drew; refuses some pairs."""

    name = "truthful"
    starts, refinement = 2, Refinement((0.3, 0.1), 0.05, 0.2, coarse_points=100, finalists=2)

    def __init__(self, refused: tuple[int, ...] = ()) -> None:
        self.refused, self.asked = refused, 0

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """As :class:`VerifiedMethod` asks."""
        k, self.asked = self.asked, self.asked + 1
        if k in self.refused:
            raise ValueError("not this one")
        drawn = random_poses(1, generator=generator)
        return torch.cat([torch.eye(4, dtype=torch.float64)[None], drawn])


def many_points() -> Pairs:
    return synthetic_pairs(3, 100, generator=seeded(0))


def test_evidence_is_kept_where_a_method_gives_some_and_nan_where_it_failed() -> None:
    given = evaluate(Truthful(refused=(1,)), many_points(), seed=1)
    assert given.failures == ("", "not this one", "")
    assert given.evidence is not None
    assert given.evidence.shape == (3, len(EVIDENCE))
    assert given.evidence.isnan().any(dim=1).tolist() == [False, True, False]
    assert given.evidence[1].isnan().all()
    residual, overlap = given.evidence[0, :2].tolist()  # the first pair is turned by 5 degrees
    assert residual < 0.01
    assert overlap > 0.99


def test_the_answers_of_a_method_that_verifies_are_those_that_it_registers() -> None:
    pairs = many_points()
    given = evaluate(Truthful(), pairs, seed=1)
    for k in range(len(pairs)):
        state = np.random.SeedSequence([1, k]).generate_state(1, np.uint64)[0]
        generator = torch.Generator().manual_seed(int(state >> np.uint64(1)))
        registered = Truthful().register(
            pairs.source[k : k + 1], pairs.target[k : k + 1], generator=generator
        )
        assert torch.equal(given.T_target_source[k], registered[0])


def test_clouds_that_register_refuses_are_failures_of_a_method_that_verifies_too() -> None:
    pairs = many_points()
    source = pairs.source.clone()
    source[2] = torch.nan
    given = evaluate(Truthful(), replace(pairs, source=source), seed=1)
    assert given.failures[:2] == ("", "")
    assert "truthful needs finite points" in given.failures[2]


def test_only_methods_that_verify_have_evidence() -> None:
    pairs = five_pairs()
    plain, verified = evaluate_all([Task(Guess(), 1), Task(Truthful((0, 1, 2, 3, 4)), 1)], pairs)
    assert plain.evidence is None
    assert verified.evidence is not None
    assert verified.evidence.isnan().all()
