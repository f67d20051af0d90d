"""From the names in params.yaml to methods."""

import pytest
import torch

from pcrdiff.registration import LearnedMethod, Method
from pipeline.catalogue import LEARNED, build_classical, build_learned, settings_of
from pipeline.settings.params import DIFFUSED, Params
from pipeline.settings.profiles import read_profile
from tests.described import REPOSITORY
from tests.pipeline.formats.test_formats import made_up_pairs


@pytest.fixture(scope="module")
def params() -> Params:
    return read_profile(REPOSITORY, "tables")


def test_every_classical_method_is_built_once_per_setting(params: Params) -> None:
    for name in params.run.classical:
        built = build_classical(name, params.methods, made_up_pairs)
        assert list(built) == list(getattr(params.methods, name))
        assert all(isinstance(method, Method) for method in built.values())
        assert {method.name for method in built.values()} == {name}


def test_every_learned_method_is_built(params: Params) -> None:
    for name in LEARNED:
        assert "paper" in settings_of(name, params.methods)
        for setting in settings_of(name, params.methods):
            method = build_learned(name, setting, params.methods, params.diffusion)
            assert isinstance(method, LearnedMethod)
            assert method.name == name


def test_every_learned_method_is_trained_in_the_tables(params: Params) -> None:
    assert params.trainings.keys() == LEARNED.keys()
    assert {*params.run.diffused, *params.run.baselines} == LEARNED.keys()


def test_the_settings_reach_the_methods(params: Params) -> None:
    built = build_classical("icp", params.methods, made_up_pairs)
    iterations = {name: vars(method)["max_iterations"] for name, method in built.items()}
    assert iterations == {"paper": 10, "official": 30}


def test_the_walk_reaches_the_learned_methods(params: Params) -> None:
    diffusion = params.diffusion.model_copy(update={"steps": 4, "sampler": "ddim"})
    for name in DIFFUSED:
        walk = vars(build_learned(name, "paper", params.methods, diffusion))["walk"]
        assert (walk.timesteps, walk.steps, walk.sampler) == (1000, 4, "ddim")


def test_the_constant_is_the_mean_of_the_training_poses(params: Params) -> None:
    pairs = made_up_pairs(3)  # quarter turns, 0, 0.1 and 0.2 along x
    (method,) = build_classical("constant", params.methods, lambda: pairs).values()
    pose = method.register(pairs.source, pairs.target, generator=torch.Generator())
    assert torch.allclose(pose[2].double(), pairs.T_target_source[1], atol=1e-6)


def test_fresh_weights_depend_on_torch_s_own_generator_alone(params: Params) -> None:
    weights = []
    for seed in (1, 1, 2):
        torch.manual_seed(seed)
        method = build_learned("pcrdiffusion_cf", "paper", params.methods, params.diffusion)
        weights.append(torch.cat([value.flatten() for value in method.parameters()]))
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])


def test_refuses_a_name_that_no_method_has(params: Params) -> None:
    with pytest.raises(ValueError, match="no learned method is called 'icp'"):
        build_learned("icp", "paper", params.methods, params.diffusion)
    with pytest.raises(ValueError, match="no classical method is called 'pcrdiffusion_cf'"):
        build_classical("pcrdiffusion_cf", params.methods, made_up_pairs)
