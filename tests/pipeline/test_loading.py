"""From the names in params.yaml to methods."""

import pytest
import torch

from pcrdiff.registration import LearnedMethod, Method
from pipeline.loading import build_classical, build_learned, method_class, settings_of
from pipeline.settings.catalogue import CATALOGUE, Entry, names_of
from pipeline.settings.params import DIFFUSED, MOVED, Params, learned_names
from pipeline.settings.profiles import read_profile
from tests.described import REPOSITORY
from tests.pipeline.formats.test_formats import synthetic_pairs


@pytest.fixture(scope="module")
def params() -> Params:
    return read_profile(REPOSITORY, "tables")


def test_every_classical_method_is_built_once_per_setting(params: Params) -> None:
    for name in params.run.classical:
        built = build_classical(name, params.methods, synthetic_pairs)
        assert list(built) == list(getattr(params.methods, name))
        assert all(isinstance(method, Method) for method in built.values())
        assert {method.name for method in built.values()} == {name}


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_method_is_the_class_of_its_name_in_its_own_file(name: str) -> None:
    found = method_class(name)
    assert vars(found)["name"] == name
    assert found.__module__ == f"pcrdiff.methods.{name}"


def test_every_file_of_a_method_has_its_line_in_the_catalogue() -> None:
    files = (REPOSITORY / "pcrdiff" / "methods").glob("*.py")
    assert {path.stem for path in files} - {"__init__"} == CATALOGUE.keys()


def test_a_line_of_the_catalogue_says_how_a_method_is_shown_and_of_which_kind_it_is() -> None:
    assert CATALOGUE["fgr"] == Entry("FGR", "classical")
    assert [*CATALOGUE][:3] == ["identity", "constant", "icp_centroid"]
    assert names_of("floor") == ["constant", "icp_centroid", "identity"]
    assert names_of("diffused", "baseline", "moved") == learned_names()
    assert len({row.shown for row in CATALOGUE.values()}) == len(CATALOGUE)


def test_every_learned_method_is_built(params: Params) -> None:
    for name in learned_names():
        assert ("paper" in settings_of(name, params.methods)) == (name not in MOVED)
        for setting in settings_of(name, params.methods):
            method = build_learned(name, setting, params.methods, params.diffusion)
            assert isinstance(method, LearnedMethod)
            assert method.name == name


def test_every_learned_method_is_trained_in_the_tables(params: Params) -> None:
    assert params.trainings.keys() == {*learned_names()} - {*MOVED}
    assert {*params.run.diffused, *params.run.baselines} == {*learned_names()} - {*MOVED}
    assert {*MOVED} <= {*params.run.shipped}


def test_the_settings_reach_the_methods(params: Params) -> None:
    built = build_classical("icp", params.methods, synthetic_pairs)
    iterations = {name: vars(method)["max_iterations"] for name, method in built.items()}
    assert iterations == {"paper": 10, "official": 30}


def test_the_walk_reaches_the_learned_methods(params: Params) -> None:
    diffusion = params.diffusion.model_copy(update={"steps": 4, "sampler": "ddim"})
    for name in DIFFUSED:
        walk = vars(build_learned(name, "paper", params.methods, diffusion))["walk"]
        assert (walk.timesteps, walk.steps, walk.sampler) == (1000, 4, "ddim")


def test_the_constant_is_the_mean_of_the_training_poses(params: Params) -> None:
    pairs = synthetic_pairs(3)  # quarter turns, 0, 0.1 and 0.2 along x
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
        build_classical("pcrdiffusion_cf", params.methods, synthetic_pairs)
