"""Starts to success: one proposal, judged at several counts."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from torch import Tensor

from pcrdiff.hypotheses import Refinement
from pcrdiff.methods.gicp_multistart import GICPMultistart
from stages.ablate_starts import FirstStarts, SearchOnce, some_of
from tests.described import expand
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, synthetic_pairs
from tests.tiny import (
    CF,
    SCENARIO,
    refusal,
    stage_main,
    tiny_params,
    with_refined_walks,
    write_params,
)

HOW = Refinement((0.5, 0.1), 0.05, 0.1, coarse_points=64, finalists=3)
ANSWERS = Path(f"results/ablations/starts/{SCENARIO}.csv")


class Counting(GICPMultistart):
    """Counts how often it is asked for starts."""

    asked = 0

    def propose(
        self, source: Tensor, target: Tensor, count: int, *, generator: torch.Generator
    ) -> Tensor:
        """As it always does."""
        self.asked += 1
        return super().propose(source, target, count, generator=generator)


def source_of_starts(starts: int = 4) -> Counting:
    return Counting(random_poses(9, generator=seeded(0)), starts, HOW)


def test_a_pair_is_searched_once_for_all_counts_and_each_pair_anew() -> None:
    source, pairs = source_of_starts(), synthetic_pairs(2, 60, generator=seeded(1))
    shared = SearchOnce(source, 4)
    for k in range(2):
        for count in (1, 2, 4):
            method = FirstStarts(shared, count)
            method.verify(pairs.source[k], pairs.target[k], generator=seeded(k))
    assert source.asked == 2


def test_all_starts_of_a_source_give_the_answer_that_it_gives_itself() -> None:
    pairs = synthetic_pairs(1, 60, generator=seeded(1))
    clouds = pairs.source[0], pairs.target[0]
    first = FirstStarts(SearchOnce(source_of_starts(), 4), 4).verify(*clouds, generator=seeded(5))
    itself = source_of_starts(4).verify(*clouds, generator=seeded(5))
    assert torch.equal(first.T_target_source, itself.T_target_source)
    np.testing.assert_array_equal(first.evidence, itself.evidence)


def test_some_pairs_are_taken_evenly_and_never_more_than_there_are() -> None:
    pairs = synthetic_pairs(7, 10, generator=seeded(1))
    assert torch.equal(some_of(pairs, 3).source, pairs.source[[0, 3, 6]])
    assert len(some_of(pairs, 9)) == 7


@pytest.fixture
def argv(project: Path) -> list[str]:
    """What the stage is told in a project that has a learned source, too."""
    params = with_refined_walks(tiny_params())
    write_params(params)
    (project / ANSWERS).unlink()
    (stage,) = (each for each in expand(params) if each.template == "ablate_starts")
    return stage.argv


def test_a_row_for_each_source_count_and_pair_and_the_same_bytes_twice(argv: list[str]) -> None:
    stage_main("ablate_starts")(argv)
    first, rows = ANSWERS.read_bytes(), pd.read_csv(ANSWERS)
    settings = {
        "gicp_multistart": ["official,starts=1", "official,starts=2"],
        CF: ["refined,starts=1", "refined,starts=2"],
    }
    for method, found in rows.groupby("method"):
        assert [*found["setting"].unique()] == settings[str(method)]
        assert len(found) == 2 * 2
    assert len(rows) == 8
    assert rows["residual"].notna().all()
    stage_main("ablate_starts")(argv)
    assert ANSWERS.read_bytes() == first


def test_a_source_that_refines_nothing_is_refused(argv: list[str]) -> None:
    params = with_refined_walks(tiny_params())
    params["ablation"]["starts"]["sources"][CF] = ["paper"]
    write_params(params)
    assert refusal("ablate_starts", argv).endswith(
        "ablation.starts.sources.pcrdiffusion_cf needs settings that refine starts, of which there "
        "are ['refined'], got ['paper']"
    )
    assert not ANSWERS.exists()


def test_weights_that_did_not_come_with_the_code_are_named(argv: list[str]) -> None:
    said = refusal(
        "ablate_starts", ["away" if word == "pcrdiff/weights" else word for word in argv]
    )
    assert f"away/{CF}/{SCENARIO}.safetensors" in said
    assert not ANSWERS.exists()
