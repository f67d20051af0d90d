"""Variants: their names, their files, and that dvc.yaml trains just these."""

from pathlib import Path
from typing import get_args

import pytest

from pcrdiff.geometry.representation import REPRESENTATIONS
from pcrdiff.models.pose_encoder import Diffusion, Fusion
from pcrdiff.models.pose_space import Scaling
from pipeline.settings import sections
from pipeline.settings.params import Params, read_params
from pipeline.settings.profiles import profile_values
from pipeline.settings.variants import (
    FUSED,
    TRAINED,
    folder_of,
    is_as_it_is,
    setting_of,
    settings_trained,
    variants,
)
from tests.described import REPOSITORY, expand, read_repository_params


@pytest.fixture(scope="module")
def params() -> Params:
    return read_params(REPOSITORY / "params.yaml")


@pytest.mark.parametrize("name", TRAINED)
def test_dvc_yaml_trains_every_variant_into_the_file_it_is_read_from(
    params: Params, name: str
) -> None:
    wanted = {
        (variant[name], Path("models", folder_of(params, name, method, variant)).parent)
        for method, variant in variants(params, name)
        if name == "representation" or not is_as_it_is(params, method, variant)
    }
    trained = {
        (stage.item["value"], Path(stage.outs[0]))
        for stage in expand(read_repository_params())
        if stage.template == f"train_{name}"
    }
    assert trained == wanted


@pytest.mark.parametrize("method", ["pcrdiffusion_cf", "pcrdiffusion_cb"])
def test_the_method_as_it_is_is_trained_once_for_all_ablations(params: Params, method: str) -> None:
    names = [name for name in TRAINED if name != "fusion" or method in FUSED]
    found = [
        (folder_of(params, name, method, variant), setting_of(variant))
        for name in names
        for of, variant in variants(params, name)
        if of == method and is_as_it_is(params, method, variant)
    ]
    assert {folder for folder, _ in found} == {
        Path(f"ablations/representation/quaternion/{method}-raw")
    }
    base = {"representation": "quaternion", "scaling": "raw"}
    assert [setting for _, setting in found] == settings_trained(params, method, base)
    assert len(found) == len(names)


def test_every_representation_is_there_in_each_scaling() -> None:
    params = Params.model_validate(profile_values(REPOSITORY, "tables"))
    found = {setting_of(variant) for _, variant in variants(params, "representation")}
    assert len(found) == 12
    assert "representation=dual_quaternion,scaling=standardised" in found


def test_a_setting_and_a_folder_say_the_variant(params: Params) -> None:
    variant = {"representation": "euler", "scaling": "raw"}
    assert setting_of(variant) == "representation=euler,scaling=raw"
    assert folder_of(params, "representation", "pcrdiffusion_cb", variant) == Path(
        "ablations/representation/euler/pcrdiffusion_cb-raw"
    )
    assert folder_of(params, "fusion", "pcrdiffusion_cf", {"fusion": "target"}) == Path(
        "ablations/fusion/target/pcrdiffusion_cf"
    )
    assert settings_trained(params, "pcrdiffusion_cf", variant) == [setting_of(variant)]


def test_params_yaml_knows_the_librarys_own_names() -> None:
    assert get_args(sections.Representation) == tuple(REPRESENTATIONS)
    assert get_args(sections.Scaling) == get_args(Scaling)
    assert get_args(sections.Fusion) == get_args(Fusion)
    assert get_args(sections.WithOrWithout) == get_args(Diffusion)
