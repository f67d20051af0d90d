"""Variants: their names, their files, and that dvc.yaml trains just these."""

from pathlib import Path
from typing import get_args

import pytest

from pcrdiff.geometry.representation import REPRESENTATIONS
from pcrdiff.models.fusion import Fusion
from pcrdiff.models.pose_encoder import Diffusion
from pcrdiff.models.pose_space import Scaling
from pipeline import sections
from pipeline.params import Params, read_params
from pipeline.variants import TRAINED, parse_variant, setting_of, variants, weights_of
from tests.described import REPOSITORY, expand, read_repository_params


@pytest.fixture(scope="module")
def params() -> Params:
    return read_params(REPOSITORY / "params.yaml")


@pytest.mark.parametrize("name", TRAINED)
def test_dvc_yaml_trains_every_variant_into_the_file_it_is_read_from(
    params: Params, name: str
) -> None:
    wanted = {
        (
            method,
            setting_of(variant),
            weights_of(Path("models/ablations") / name, method, variant).as_posix(),
        )
        for method, variant in variants(params.ablation, name)
    }
    trained = set()
    for stage in expand(read_repository_params()):
        if stage.template == f"train_{name}":
            told = dict(zip(stage.argv[::2], stage.argv[1::2], strict=True))
            trained.add((told["--method"], told["--variant"], told["--weights"]))
    assert trained == wanted


def test_every_representation_is_there_in_each_scaling(params: Params) -> None:
    found = {setting_of(variant) for _, variant in variants(params.ablation, "representation")}
    assert len(found) == 12
    assert "representation=dual_quaternion,scaling=standardised" in found


def test_a_setting_says_the_variant() -> None:
    variant = {"representation": "euler", "scaling": "raw"}
    assert setting_of(variant) == "representation=euler,scaling=raw"
    assert parse_variant(setting_of(variant)) == variant
    assert parse_variant("") == {}
    weights = weights_of(Path("there"), "pcrdiffusion_cb", variant)
    assert weights == Path("there/pcrdiffusion_cb-euler-raw.safetensors")


@pytest.mark.parametrize("setting", ["fusion", "fusion=", "=source", "fusion=source,"])
def test_a_setting_that_is_none_is_refused(setting: str) -> None:
    with pytest.raises(ValueError, match="a variant needs key=value"):
        parse_variant(setting)


def test_params_yaml_knows_the_librarys_own_names() -> None:
    assert get_args(sections.Representation) == tuple(REPRESENTATIONS)
    assert get_args(sections.Scaling) == get_args(Scaling)
    assert get_args(sections.Fusion) == get_args(Fusion)
    assert get_args(sections.WithOrWithout) == get_args(Diffusion)
