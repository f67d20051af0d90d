"""Running a method over the test pairs, and what is said of its errors."""

from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.evaluation import Estimates
from pcrdiff.registration import Method, Pairs
from pipeline import loading
from pipeline.answering import (
    answer,
    answer_all,
    answer_settings,
    headline,
    mean_error_r_deg,
)
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import write_weights
from pipeline.loading import load_learned, load_settings
from pipeline.settings.params import Params, read_params
from pipeline.settings.seeding import stream
from tests.pipeline.formats.test_formats import synthetic_pairs
from tests.tiny import CF, PAIRS, tiny_params, weights, write_params

WEIGHTS = weights(CF)


def answers_of(params: Params, name: str, weights: Path | None = WEIGHTS) -> Tensor:
    """The poses that a method answers the test pairs with in the paper's setting."""
    settings = load_settings(params, name, PAIRS, weights)
    answers = answer_settings(params, settings, read_pairs(PAIRS, "test"))
    return answers["paper"].T_target_source


def turned(angle_deg: float, shift: float) -> torch.Tensor:
    """A turn about x, and a shift along y."""
    T_target_source = torch.eye(4, dtype=torch.float64)
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    T_target_source[1:3, 1:3] = torch.tensor([[c, -s], [s, c]])
    T_target_source[1, 3] = shift
    return T_target_source


def still(count: int) -> Pairs:
    """Pairs whose true pose is the identity."""
    pairs, poses = synthetic_pairs(count), torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    return Pairs(pairs.source, pairs.target, poses, pairs.item, pairs.group)


def test_the_mean_error_is_worked_by_hand_and_counts_what_failed() -> None:
    poses = torch.stack([turned(10, 0.1), turned(20, 0.2), turned(60, 0.6), turned(30, 0.3)])
    given = Estimates(poses, ("", "", "no", ""))
    assert mean_error_r_deg(still(4), given) == pytest.approx(30.0)
    assert headline({"official": given}) is given
    other = Estimates(poses[:1], ("",))
    assert headline({"official": other, "paper": given}) is given


class Fussy(Method):
    """Answers the identity, but not for clouds whose first point lies left of the origin."""

    name = "fussy"

    def answer(
        self, source: torch.Tensor, target: torch.Tensor, *, generator: torch.Generator
    ) -> torch.Tensor:
        """As every method does."""
        del target, generator
        if source[0, 0, 0] < 0:
            raise ValueError("fussy does not like it\nat all")
        return torch.eye(4).repeat(len(source), 1, 1)


def test_a_pair_that_a_method_fails_on_is_counted_and_scored_as_the_identity(
    project: Path,
) -> None:
    pairs = read_pairs(project / PAIRS, "test")
    left = (pairs.source[:, 0, 0] < 0).tolist()
    source = pairs.source.clone()
    source[0, 0, 0], left[0] = -1.0, True
    source[1, 0, 0], left[1] = 1.0, False
    pairs = Pairs(source, pairs.target, pairs.T_target_source, pairs.item, pairs.group)
    given = answer(read_params(), Fussy(), pairs)
    assert [bool(failure) for failure in given.failures] == left
    assert given.failures[0] == "fussy does not like it"
    assert torch.equal(given.T_target_source, torch.eye(4).double().repeat(len(pairs), 1, 1))


class Drawing(Method):
    """Answers a shift that its generator drew."""

    name = "drawing"

    def answer(
        self, source: torch.Tensor, target: torch.Tensor, *, generator: torch.Generator
    ) -> torch.Tensor:
        """As every method does."""
        del target
        pose = torch.eye(4).repeat(len(source), 1, 1)
        pose[:, 0, 3] = torch.rand(len(source), generator=generator)
        return pose


@pytest.mark.usefixtures("project")
def test_each_pair_and_draw_has_a_seed_of_its_own_the_same_for_every_method() -> None:
    params, pairs = read_params(), read_pairs(PAIRS, "test")
    drawn = {"first": (Drawing(), 0), "second": (Drawing(), 1), "again": (Drawing(), 0)}
    answers = {
        name: given.T_target_source for name, given in answer_all(params, drawn, pairs).items()
    }
    assert torch.equal(answers["first"], answers["again"])
    assert not torch.equal(answers["first"], answers["second"])
    for draw, name in enumerate(("evaluate", "evaluate/1")):
        shifts = []
        for k in range(len(pairs)):
            words = np.random.SeedSequence([stream(params.seed, name), k]).generate_state(
                1, np.uint64
            )
            generator = torch.Generator().manual_seed(int(words[0] >> np.uint64(1)))
            shifts.append(torch.rand(1, generator=generator).item())
        assert list(answers.values())[draw][:, 0, 3].tolist() == pytest.approx(shifts)


@pytest.mark.usefixtures("project")
def test_the_same_params_give_the_same_answers() -> None:
    params = read_params()
    assert torch.equal(answers_of(params, CF), answers_of(params, CF))


@pytest.mark.usefixtures("project")
def test_another_seed_gives_a_sampler_another_answer() -> None:
    params = read_params()
    other = params.model_copy(update={"seed": params.seed + 1})
    assert not torch.equal(answers_of(params, CF), answers_of(other, CF))


def test_a_constant_is_taken_from_the_training_pairs_and_not_from_the_test_pairs(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def read(path: Path, split: str) -> Pairs:
        asked.append(split)
        return read_pairs(path, split)

    monkeypatch.setattr(loading, "read_pairs", read)
    for name in ("identity", "icp"):
        load_settings(read_params(), name, project / PAIRS, None)
    assert asked == []
    load_settings(read_params(), "constant", project / PAIRS, None)
    assert asked == ["train"]


def test_refuses_weights_of_another_size_and_names_the_file(project: Path) -> None:
    params = tiny_params()
    params["methods"][CF]["network"]["feature_dim"] = 32
    write_params(params)
    read = read_params()
    with pytest.raises(ValueError, match=rf"{WEIGHTS} does not fit {CF} as params\.yaml has it"):
        load_learned(CF, "paper", read.methods, read.diffusion, WEIGHTS)
    assert project.is_dir()


def test_refuses_weights_that_lack_a_tensor(project: Path) -> None:
    write_weights(project / "a.safetensors", {"b": torch.ones(1)}, {"method": CF})
    params = read_params()
    with pytest.raises(ValueError, match=rf"a\.safetensors does not fit {CF}"):
        load_learned(CF, "paper", params.methods, params.diffusion, project / "a.safetensors")
