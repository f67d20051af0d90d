"""Running a method over the test pairs, and what is said of its errors."""

from math import cos, radians, sin
from pathlib import Path

import pytest
import torch

from pcrdiff.evaluation import Estimates
from pcrdiff.registration import Pairs
from pipeline import evaluating
from pipeline.artifacts import read_pairs, write_weights
from pipeline.evaluating import answer, evaluate_method, load_learned, summarise
from pipeline.params import read_params
from tests.pipeline.test_artifacts import made_up_pairs
from tests.tiny import CF, PAIRS, SCENARIO, tiny_params, write_params

WEIGHTS = Path(f"models/{SCENARIO}/{CF}.safetensors")


def turned(angle_deg: float, shift: float) -> torch.Tensor:
    """A turn about x, and a shift along y."""
    T_target_source = torch.eye(4, dtype=torch.float64)
    c, s = cos(radians(angle_deg)), sin(radians(angle_deg))
    T_target_source[1:3, 1:3] = torch.tensor([[c, -s], [s, c]])
    T_target_source[1, 3] = shift
    return T_target_source


def still(count: int) -> Pairs:
    """Pairs whose true pose is the identity."""
    pairs, poses = made_up_pairs(count), torch.eye(4, dtype=torch.float64).repeat(count, 1, 1)
    return Pairs(pairs.source, pairs.target, poses, pairs.item, pairs.group)


def test_the_summary_is_worked_by_hand() -> None:
    given = torch.stack([turned(10, 0.1), turned(20, 0.2), turned(60, 0.6), turned(30, 0.3)])
    summary = summarise(still(4), {"paper": Estimates(given, ("", "", "no", ""))})
    assert summary == pytest.approx(
        {
            "paper.error_r_deg": 30.0,
            "paper.median_error_r_deg": 25.0,
            "paper.error_t": 0.3,
            "paper.failures": 1.0,
        }
    )


def test_the_summary_has_every_setting() -> None:
    given = Estimates(turned(10, 0.1)[None], ("",))
    summary = summarise(still(1), {"paper": given, "official": given})
    assert {key.partition(".")[0] for key in summary} == {"paper", "official"}


class Fussy:
    """Answers the identity, but not for clouds whose first point lies left of the origin."""

    name = "fussy"

    def register(
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


def test_the_same_params_give_the_same_answers(project: Path) -> None:
    params = read_params()
    first, second = (evaluate_method(params, CF, project / PAIRS, WEIGHTS)[1] for _ in range(2))
    assert torch.equal(first["paper"].T_target_source, second["paper"].T_target_source)


def test_another_seed_gives_a_sampler_another_answer(project: Path) -> None:
    params = read_params()
    other = params.model_copy(update={"seed": params.seed + 1})
    first, second = (evaluate_method(p, CF, project / PAIRS, WEIGHTS)[1] for p in (params, other))
    assert not torch.equal(first["paper"].T_target_source, second["paper"].T_target_source)


def test_a_constant_is_taken_from_the_training_pairs_and_not_from_the_test_pairs(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def read(path: Path, split: str) -> Pairs:
        asked.append(split)
        return read_pairs(path, split)

    monkeypatch.setattr(evaluating, "read_pairs", read)
    test, _ = evaluate_method(read_params(), "constant", project / PAIRS, None)
    assert asked == ["train", "test"]
    assert len(test) == 3


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
