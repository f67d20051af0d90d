"""The ablations vary one thing."""

import csv
from pathlib import Path

import pytest
import torch
from torch import Tensor

from pipeline.answering import answer_settings
from pipeline.formats.pairs import read_pairs
from pipeline.loading import load_settings
from pipeline.settings.params import read_params
from stages.ablate import ABLATIONS, Given
from stages.ablate_noise import add_noise
from tests.described import expand, read_repository_params
from tests.tiny import CB, CF, PAIRS, SCENARIO, tiny_params, weights

MODELS = Path("models")
WALKS = [
    f"steps={n},sampler={s}{d}" for s in ("ddpm", "ddim") for n in (1, 2) for d in ("", ",draw=1")
]
SETTINGS = {
    "diffusion": ["diffusion=with", "diffusion=without"],
    "representation": [
        f"representation={r},scaling={s}"
        for r in ("quaternion", "twist")
        for s in ("raw", "standardised")
    ],
    "fusion": ["fusion=source", "fusion=target", "fusion=concat"],
    "steps": WALKS,
    "hypotheses": ["hypotheses=1", "hypotheses=2"],
}
METHODS = {"fusion": [CF]}


def given(project: Path) -> Given:
    return Given(read_params(), read_pairs(project / PAIRS, "test"), MODELS)


def evaluated(method: str) -> Tensor:
    """The poses of the evaluation."""
    params = read_params()
    settings = load_settings(params, method, PAIRS, weights(method))
    answers = answer_settings(params, settings, read_pairs(PAIRS, "test"))
    return answers["paper"].T_target_source


@pytest.mark.parametrize("name", ABLATIONS)
def test_each_method_answers_all_pairs_under_each_value(project: Path, name: str) -> None:
    ablated = given(project)
    test, answers = ablated.test, ABLATIONS[name](ablated)
    assert list(answers) == METHODS.get(name, [CF, CB])
    for method, settings in answers.items():
        drawn_once = (name, method) == ("steps", CB)
        assert list(settings) == [s for s in SETTINGS[name] if not (drawn_once and "draw" in s)]
        assert all(len(found.failures) == len(test) for found in settings.values())


def test_more_steps_another_sampler_and_another_draw_give_another_answer(project: Path) -> None:
    answers = ABLATIONS["steps"](given(project))
    poses = {setting: found.T_target_source for setting, found in answers[CF].items()}
    first = poses["steps=2,sampler=ddpm"]
    for other in ("steps=1,sampler=ddpm", "steps=2,sampler=ddim", "steps=2,sampler=ddpm,draw=1"):
        assert not torch.allclose(first, poses[other], atol=1e-6), other


def test_the_walk_of_the_evaluation_gives_the_evaluation_s_answers(project: Path) -> None:
    params = read_params()
    answers = ABLATIONS["steps"](given(project))
    walk = answers[CF][f"steps={params.diffusion.steps},sampler={params.diffusion.sampler}"]
    assert torch.equal(walk.T_target_source, evaluated(CF))


def test_one_hypothesis_is_the_evaluation(project: Path) -> None:
    answers = ABLATIONS["hypotheses"](given(project))
    found = answers[CB]["hypotheses=1"].T_target_source
    assert torch.equal(found, evaluated(CB))


def test_without_diffusion_the_walk_does_not_matter(project: Path) -> None:
    params = read_params()
    longer = params.diffusion.model_copy(update={"steps": 4})
    more = Given(
        params.model_copy(update={"diffusion": longer}), read_pairs(project / PAIRS, "test"), MODELS
    )
    one = ABLATIONS["diffusion"](given(project))
    four = ABLATIONS["diffusion"](more)
    for method in (CF, CB):
        a, b = (found[method]["diffusion=without"].T_target_source for found in (one, four))
        torch.testing.assert_close(a, b, atol=1e-6, rtol=0)
        a, b = (found[method]["diffusion=with"].T_target_source for found in (one, four))
        assert not torch.allclose(a, b, atol=1e-6)


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", ["identity", CF])
def test_without_noise_a_method_answers_as_evaluated_and_with_noise_otherwise(method: str) -> None:
    _, *rows = csv.reader(Path(f"results/ablations/noise/{method}.csv").read_text().splitlines())
    _, *plain = csv.reader(Path(f"results/{method}/{SCENARIO}.csv").read_text().splitlines())
    assert [row[:1] + row[4:5] for row in rows] == [
        [method, setting] for setting in ("noise=0", "noise=0.02") for _ in plain
    ]
    clean, noisy = ([row[5:] for row in rows if row[4] == f"noise={n}"] for n in ("0", "0.02"))
    assert clean == [row[4:] for row in plain]
    assert (noisy == clean) == (method == "identity")


def test_noise_has_the_deviation_it_says_and_grows_from_the_same_draw(project: Path) -> None:
    pairs = read_pairs(project / PAIRS, "test")
    little, much = (add_noise(pairs, deviation, seed=3) for deviation in (0.01, 0.02))
    for name in ("source", "target"):
        clean = getattr(pairs, name)
        noise, more = (getattr(noisy, name) - clean for noisy in (little, much))
        assert noise.std().item() == pytest.approx(0.01, rel=0.1)
        torch.testing.assert_close(more, 2 * noise, atol=1e-6, rtol=0)
    assert not torch.allclose(little.source - pairs.source, little.target - pairs.target)
    assert add_noise(pairs, 0.0, seed=3) is pairs
    assert torch.equal(add_noise(pairs, 0.01, seed=3).source, little.source)


@pytest.mark.parametrize("name", ["steps", "representation"])
def test_refuses_a_folder_without_weights(project: Path, name: str) -> None:
    with pytest.raises(FileNotFoundError, match=r"\.safetensors, there are none: run train"):
        ABLATIONS[name](
            Given(read_params(), read_pairs(project / PAIRS, "test"), project / "nowhere")
        )


def test_dvc_yaml_runs_every_ablation() -> None:
    stages = [s for s in expand(read_repository_params()) if s.template.startswith("ablate")]
    files = [Path(out) for stage in stages for out in stage.outs]
    assert sorted(file.stem for file in files) == sorted([*ABLATIONS, "walks", "modelnet40-rpm"])
    noisy = [s for s in expand(tiny_params()) if s.template == "ablate_noise"]
    assert [stage.item["method"] for stage in noisy] == ["identity", CF]
