"""The ablations vary one thing."""

from pathlib import Path

import pytest
import torch

from pipeline.ablating import ABLATIONS, ablate_steps
from pipeline.evaluating import evaluate_method
from pipeline.params import Ablation, read_params
from tests.described import read_templates
from tests.tiny import CB, CF, PAIRS, SCENARIO

MODELS = Path(f"models/{SCENARIO}")


def test_each_learned_method_answers_under_each_number_of_steps(project: Path) -> None:
    test, answers = ablate_steps(read_params(), project / PAIRS, MODELS)
    assert list(answers) == [CF, CB]
    for settings in answers.values():
        assert list(settings) == ["steps=1", "steps=2"]
        assert all(len(given.failures) == len(test) for given in settings.values())


def test_more_steps_give_another_answer(project: Path) -> None:
    _, answers = ablate_steps(read_params(), project / PAIRS, MODELS)
    one, two = (given.T_target_source for given in answers[CF].values())
    assert not torch.allclose(one, two, atol=1e-6)


def test_the_steps_of_the_evaluation_give_the_evaluation_s_answers(project: Path) -> None:
    params = read_params()
    _, answers = ablate_steps(params, project / PAIRS, MODELS)
    _, evaluated = evaluate_method(params, CF, project / PAIRS, MODELS / f"{CF}.safetensors")
    given = answers[CF][f"steps={params.diffusion.steps}"]
    assert torch.equal(given.T_target_source, evaluated["paper"].T_target_source)


def test_the_steps_of_the_evaluation_are_always_among_them(project: Path) -> None:
    ablation = Ablation(scenario=SCENARIO, methods=[CF, CB], steps=[5, 2, 5])
    params = read_params().model_copy(update={"ablation": ablation})
    _, answers = ablate_steps(params, project / PAIRS, MODELS)
    assert list(answers[CF]) == ["steps=1", "steps=2", "steps=5"]


def test_refuses_a_folder_without_weights(project: Path) -> None:
    with pytest.raises(FileNotFoundError, match=rf"{CF}\.safetensors, there are none: run train"):
        ablate_steps(read_params(), project / PAIRS, project / "nowhere")


def test_dvc_yaml_runs_every_ablation() -> None:
    assert set(read_templates()["ablate"]["matrix"]["name"]) == ABLATIONS.keys()
