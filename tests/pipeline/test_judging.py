"""Verdicts are learned from answers to the validation pairs, and from nothing else."""

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.hypotheses import Refinement, Starts, Verified, VerifiedMethod
from pcrdiff.registration import Method, Pairs, Source, Target
from pcrdiff.verdict import fit_verdict
from pipeline import judging
from pipeline.answering import answer
from pipeline.formats.pairs import read_pairs
from pipeline.judging import learn_verdicts
from pipeline.settings.params import read_params
from tests.tiny import PAIRS


class Sure(VerifiedMethod):
    """Answers the identity, and is surer the larger the number that its generator drew."""

    name = "sure"
    starts, refinement = 1, Refinement((0.1,), 0.1, 0.1, 1, 1)

    def __init__(self) -> None:
        self.drawn: list[float] = []

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """Not asked."""
        raise NotImplementedError

    def judge(self, source: Source, target: Target, *, generator: torch.Generator) -> Verified:
        """As :class:`VerifiedMethod` does."""
        self.drawn.append(torch.rand(1, generator=generator).item())
        return Verified(torch.eye(4, dtype=torch.float64), self.drawn[-1], 1.0, 1.0, 1.0, 1.0, 1.0)


class Silent(Method):
    """Answers the identity and says no more."""

    name = "silent"

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """As every method does."""
        return torch.eye(4).repeat(len(source), 1, 1)


@pytest.mark.usefixtures("project")
def test_a_verdict_is_fitted_to_the_answers_to_the_validation_pairs() -> None:
    method = Sure()
    found = learn_verdicts(read_params(), {"paper": method, "silent": Silent()}, PAIRS)
    known = read_pairs(PAIRS, "val")
    evidence = np.ones((len(known), 6))
    evidence[:, 0] = method.drawn
    assert len(known) == found["paper"].pairs > 1
    assert found == {"paper": fit_verdict(evidence, np.zeros(len(known), bool))}


@pytest.mark.usefixtures("project")
def test_right_is_said_of_the_validation_pairs_own_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    known = read_pairs(PAIRS, "val")
    still = torch.eye(4, dtype=torch.float64).repeat(len(known), 1, 1)
    still[0] = known.T_target_source[0]
    moved = Pairs(known.source, known.target, still, known.item, known.group)
    asked: list[tuple[Path, str]] = []

    def read(path: Path, split: str) -> Pairs:
        asked.append((path, split))
        return moved

    monkeypatch.setattr(judging, "read_pairs", read)
    found = learn_verdicts(read_params(), {"paper": Sure()}, PAIRS)["paper"]
    assert (found.pairs, found.right) == (len(known), len(known) - 1)
    assert asked == [(PAIRS, "val")]


@pytest.mark.usefixtures("project")
def test_other_draws_are_made_than_at_the_test() -> None:
    params, validated, tested = read_params(), Sure(), Sure()
    learn_verdicts(params, {"paper": validated}, PAIRS)
    answer(params, tested, read_pairs(PAIRS, "test"))
    assert not {*validated.drawn} & {*tested.drawn}


def test_no_pairs_are_read_for_methods_that_never_say(tmp_path: Path) -> None:
    assert learn_verdicts(read_params(), {"paper": Silent()}, tmp_path / "none.h5") == {}
