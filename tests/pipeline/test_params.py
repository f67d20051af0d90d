"""params.yaml is refused in one sentence that names the file and the key."""

from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from pipeline.params import read_params
from tests.described import read_repository_params, write_yaml

Change = Callable[[dict[str, Any]], Any]


def sentence(folder: Path, change: Change) -> str:
    """What is said of params.yaml after a change to it."""
    params = read_repository_params()
    change(params)
    path = folder / "params.yaml"
    write_yaml(path, params)
    with pytest.raises(ValueError, match="params") as refused:
        read_params(path)
    said = str(refused.value)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    return said.removeprefix(f"{path}: ")


def test_the_repository_s_params_are_read(repository: Path) -> None:
    params = read_params(repository / "params.yaml")
    assert params.scenarios["kitti"].max_rotation == pytest.approx(pi / 4)
    assert list(params.methods.icp) == ["paper", "official"]


def test_params_cannot_be_changed(repository: Path) -> None:
    params = read_params(repository / "params.yaml")
    with pytest.raises(ValidationError, match="frozen"):
        params.seed = 8


WRONG: dict[str, tuple[Change, str]] = {
    "a missing key": (lambda p: p["train"]["pcrdiffusion_cf"].pop("patience"),
        "train.pcrdiffusion_cf.patience: Field required"),
    "a missing section": (lambda p: p.pop("diffusion"), "diffusion: Field required"),
    "an extra key": (lambda p: p["diffusion"].update(stepps=3),
        "diffusion.stepps: Extra inputs are not permitted, got 3"),
    "a word for a count": (lambda p: p["diffusion"].update(timesteps="many"),
        "diffusion.timesteps: Input should be a valid integer, got 'many'"),
    "a precision that there is not": (lambda p: p.update(search_precision="half"),
        "search_precision: Input should be 'float32', 'bfloat16' or 'auto', got 'half'"),
    "a number in quotes": (lambda p: p.update(seed="7"),
        "seed: Input should be a valid integer, got '7'"),
    "a fraction for a count": (lambda p: p["scenarios"]["kitti"].update(num_points=1.5),
        "scenarios.kitti.num_points: Input should be a valid integer"),
    "a count of none": (lambda p: p["trainings"]["kitti-pcrdiffusion_cf"].update(epochs=0),
        "trainings.kitti-pcrdiffusion_cf.epochs: Input should be greater than or equal to 1, got 0"),
    "an unknown sampler": (lambda p: p["diffusion"].update(sampler="euler"),
        "diffusion.sampler: Input should be 'ddpm' or 'ddim', got 'euler'"),
    "no number": (lambda p: p["scenarios"]["kitti"].update(max_translation=float("nan")),
        "scenarios.kitti.max_translation: "),
    "nothing kept": (lambda p: p["scenarios"]["modelnet40-partial"].update(keep=0.0),
        "scenarios.modelnet40-partial.keep: Input should be greater than 0, got 0.0"),
    "more steps than times": (lambda p: p["diffusion"].update(steps=1001),
        "diffusion: steps must be at most timesteps 1000, got 1001"),
    "a local source without root": (lambda p: p["acquire"]["kitti"].update(source="local"),
        "acquire.kitti: source local needs root"),
    "a download of nothing": (lambda p: p["acquire"]["3dmatch"].update(source="download"),
        "acquire.3dmatch: source download needs archives"),
    "a synthetic source without sizes": (lambda p: p["acquire"]["kitti"].update(synthetic=None),
        "acquire.kitti: synthetic of kitti needs ['scans_per_sequence', 'sequences'], got []"),
    "another family's sizes": (
        lambda p: p["acquire"]["kitti"].update(synthetic=p["acquire"]["modelnet40"]["synthetic"]),
        "acquire.kitti: synthetic of kitti needs ['scans_per_sequence', 'sequences'], got ['te"),
    "an ill-typed size": (
        lambda p: p["acquire"]["kitti"]["synthetic"].update(scans_per_sequence="8"),
        "acquire.kitti.synthetic.scans_per_sequence: Input should be a valid integer, got '8'"),
    "a data set that is not there": (lambda p: p["scenarios"]["kitti"].update(dataset="waymo"),
        "scenarios.kitti.dataset 'waymo' is not in acquire"),
    "a scenario that is not there": (lambda p: p["run"]["scenarios"].append("waymo"),
        "run.scenarios needs the same names as scenarios: {'waymo'} differ"),
    "a training on what is not there": (
        lambda p: p["trainings"]["kitti-pcrdiffusion_cf"].update(scenario="waymo"),
        "trainings.kitti-pcrdiffusion_cf.scenario 'waymo' is not in scenarios"),
    "a training of what learns nothing": (
        lambda p: p["trainings"]["kitti-pcrdiffusion_cf"].update(method="icp"),
        "trainings.kitti-pcrdiffusion_cf.method needs one of ["),
    "a training under another's name": (
        lambda p: p["trainings"].update(mine=p["trainings"]["kitti-pcrdiffusion_cf"]),
        "trainings.mine needs the key 'kitti-pcrdiffusion_cf'"),
    "an ablation of what does not diffuse": (
        lambda p: p["ablation"]["methods"].append("dcp_v2"),
        "ablation.methods needs some of ['pcrdiffusion_cf', 'pcrdiffusion_cb'], got 'dcp_v2'"),
    "an ablation of what is not trained": (
        lambda p: p["trainings"].pop("modelnet40-unseen_objects-pcrdiffusion_cb"),
        "ablation.methods needs 'modelnet40-unseen_objects-pcrdiffusion_cb', which trainings has"),
    "no number of draws": (lambda p: p["ablation"]["sampling"]["draws"].pop("pcrdiffusion_cb"),
        "ablation.sampling.draws needs a number for pcrdiffusion_cb, has ['pcrdiffusion_cf']"),
    "noise on what is not trained": (
        lambda p: p["ablation"]["noise"]["methods"].append("egst"),
        "ablation.noise.methods needs 'modelnet40-gaussian_noise-egst', which trainings has not"),
    "an ablation over nothing": (lambda p: p["ablation"].update(representations=[]),
        "ablation.representations: List should have at least 1 item"),
    "an unknown representation": (
        lambda p: p["ablation"].update(representations=["quaternion", "axis"]),
        "ablation.representations.1: Input should be 'quaternion', 'euler', 'rotation_6d', "),
    "answers that do not hang on the walk": (
        lambda p: p["trainings"]["kitti-pcrdiffusion_cf"].update(answers="seed"),
        "trainings.kitti-pcrdiffusion_cf.answers needs 'diffusion', got 'seed'"),
    "times that hang on the walk": (
        lambda p: p["timing"]["learned"]["fmr"].update(answers="diffusion"),
        "timing.learned.fmr.answers needs 'methods.fmr.settings', got 'diffusion'"),
    "a fusion that is none": (
        lambda p: p["methods"]["pcrdiffusion_cf"]["network"].update(fusion="sum"),
        "methods.pcrdiffusion_cf.network.fusion: Input should be 'source', 'target' or 'concat'"),
    "an ablation of nothing": (lambda p: p["ablation"].update(scenario="waymo"),
        "ablation.scenario 'waymo' is not in scenarios"),
    "an unknown setting": (lambda p: p["methods"]["icp"].update(mine=p["methods"]["icp"]["paper"]),
        "methods.icp.mine"),
}  # fmt: skip
"""What is done to params.yaml, and what has to be said of it."""


@pytest.mark.parametrize("name", WRONG)
def test_refuses(tmp_path: Path, name: str) -> None:
    change, expected = WRONG[name]
    assert expected in sentence(tmp_path, change)


def test_refuses_what_is_not_yaml(tmp_path: Path) -> None:
    path = tmp_path / "params.yaml"
    path.write_text("seed: [7\n")
    with pytest.raises(ValueError, match=r"params\.yaml is not YAML: ") as refused:
        read_params(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("content", ["", "7\n", "- seed\n"])
def test_refuses_what_is_no_mapping(tmp_path: Path, content: str) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"params\.yaml: the file: ") as refused:
        read_params(path)
    assert "\n" not in str(refused.value)


def test_refuses_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "params.yaml"
    path.write_bytes(b"seed: \xff\n")
    with pytest.raises(ValueError, match=r"params\.yaml"):
        read_params(path)


def test_says_where_it_looked_for_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"params\.yaml"):
        read_params(tmp_path / "params.yaml")
