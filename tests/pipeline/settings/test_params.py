"""params.yaml is refused in one sentence that names the file and the key."""

from collections.abc import Callable, Iterator
from math import pi
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from pipeline.settings.params import Params, read_params
from tests.described import REPOSITORY, read_repository_params, write_yaml

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
    assert params.methods.icp is not None
    assert list(params.methods.icp) == ["paper"]


def test_the_epochs_of_a_training_are_found(repository: Path) -> None:
    plain = read_repository_params()["trainings"]
    params = read_params(repository / "params.yaml")
    for method in ("pcrdiffusion_cf", "rpmnet"):
        found = params.training("kitti", method)
        assert (found.epochs, found.start) == (plain[method]["kitti"], None)
    with pytest.raises(ValueError, match=r"params.yaml has no trainings\.rpmnet\.waymo, there are"):
        params.training("waymo", "rpmnet")


def test_a_training_may_start_from_what_is_shipped_for_a_scenario(tmp_path: Path) -> None:
    params = read_repository_params()
    params["trainings"]["rpmnet"]["kitti"] = {"epochs": 2, "start": "elsewhere"}
    write_yaml(tmp_path / "params.yaml", params)
    found = read_params(tmp_path / "params.yaml").training("kitti", "rpmnet")
    assert (found.epochs, found.start) == (2, "elsewhere")


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
    "a count of none": (lambda p: p["trainings"]["pcrdiffusion_cf"].update(kitti=0),
        "trainings.pcrdiffusion_cf.kitti.epochs: Input should be greater than or equal to 1, got 0"),
    "a word for epochs": (lambda p: p["trainings"]["pcrdiffusion_cf"].update(kitti="5"),
        "trainings.pcrdiffusion_cf.kitti.epochs: Input should be a valid integer, got '5'"),
    "a start without epochs": (
        lambda p: p["trainings"]["pcrdiffusion_cf"].update(kitti={"start": "kitti"}),
        "trainings.pcrdiffusion_cf.kitti.epochs: Field required"),
    "a start that leads out of the folder": (
        lambda p: p["trainings"]["pcrdiffusion_cf"].update(kitti={"epochs": 1, "start": "../x"}),
        "trainings.pcrdiffusion_cf.kitti.start: a name needs 1 to 64 of "),
    "an unknown sampler": (lambda p: p["diffusion"].update(sampler="euler"),
        "diffusion.sampler: Input should be 'ddpm', 'ddim' or 'feedback', got 'euler'"),
    "a range that falls": (lambda p: p["scenarios"]["kitti"].update(min_translation=2.0),
        "scenarios.kitti: min_translation must be at most max_translation 1.0, got 2.0"),
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
    "training on a scenario that is not there": (lambda p: p["run"]["trained"].append("waymo"),
        "run.trained 'waymo' is not in scenarios"),
    "a training on what is not there": (
        lambda p: p["trainings"]["pcrdiffusion_cf"].update(waymo=1),
        "trainings.pcrdiffusion_cf 'waymo' is not in scenarios"),
    "a training of what learns nothing": (lambda p: p["trainings"].update(icp={"kitti": 1}),
        "trainings needs some of ['dcp_v1', 'dcp_v2', 'deepgmr', 'egst', 'fmr', 'pcrdiffusion_cb', "),
    "a baseline that walks": (lambda p: p["run"]["baselines"].append("pcrdiffusion_cf"),
        "'pointnetlk', 'rpmnet'], got 'pcrdiffusion_cf'"),
    "a baseline that learns nothing": (lambda p: p["run"]["baselines"].append("icp"),
        "run.baselines needs some of ['dcp_v1', 'dcp_v2', 'deepgmr', 'egst', 'fmr', 'pcrdiffusion_cb_moved', 'pcrnet', "),
    "a baseline without a training": (lambda p: p["trainings"].pop("pcrnet"),
        "run.baselines needs trainings.pcrnet, which is not there"),
    "a baseline of no settings": (lambda p: p["methods"].pop("pcrnet"),
        "pcrnet needs a section methods.pcrnet, there is none"),
    "a section on training a method that learns nothing": (
        lambda p: p["train"].update(icp=p["train"]["pcrnet"]),
        "train needs some of ['dcp_v1', "),
    "an ablated method that nobody says how to train": (
        lambda p: p["train"].pop("pcrdiffusion_cb"),
        "pcrdiffusion_cb needs a section train.pcrdiffusion_cb, there is none"),
    "a baseline that nobody says how to train": (lambda p: p["train"].pop("pcrnet"),
        "pcrnet needs a section train.pcrnet, there is none"),
    "a classical method of no settings": (lambda p: p["run"]["classical"].append("gicp"),
        "gicp needs a section methods.gicp, there is none"),
    "a baseline of no epochs": (lambda p: p["trainings"]["pcrnet"].update(kitti=0),
        "trainings.pcrnet.kitti.epochs: Input should be greater than or equal to 1, got 0"),
    "a scenario without PCRDiffusion": (lambda p: p["trainings"]["pcrdiffusion_cb"].pop("kitti"),
        "run.diffused needs trainings.pcrdiffusion_cb.kitti, which is not there"),
    "no PCRDiffusion at all": (lambda p: p["run"].update(diffused=[]),
        "run.diffused: List should have at least 1 item"),
    "a diffused method that does not walk": (lambda p: p["run"]["diffused"].append("rpmnet"),
        "run.diffused needs some of ['pcrdiffusion_cf', 'pcrdiffusion_cb'], got 'rpmnet'"),
    "normals that the pairs do not keep": (
        lambda p: p["methods"]["rpmnet"]["network"].update(normals="given"),
        "methods.rpmnet.network.normals is given, which needs scenarios.modelnet40-unseen_objects."),
    "an ablation of what does not diffuse": (
        lambda p: p["ablation"]["methods"].append("dcp_v2"),
        "ablation.methods needs some of ['pcrdiffusion_cf', 'pcrdiffusion_cb'], got 'dcp_v2'"),
    "a method that there is not": (lambda p: p["run"]["classical"].append("it's"),
        "run.classical needs some of ['constant', 'fgr', 'gicp', 'gicp_multistart', 'icp', 'icp_centroid', 'identity',"),
    "a learned method among the others": (lambda p: p["run"]["classical"].append("dcp_v2"),
        "'small_gicp', 'trimmed_icp'], got 'dcp_v2'"),
    "noise on a method that there is not": (
        lambda p: p["ablation"]["noise"]["methods"].append("a b"),
        "ablation.noise.methods needs some of ['constant', "),
    "an ablation of what is not trained": (
        lambda p: (p["run"]["diffused"].pop(), p["trainings"].pop("pcrdiffusion_cb")),
        "ablation.methods needs trainings.pcrdiffusion_cb.modelnet40-unseen_objects, which is not"),
    "no number of draws": (lambda p: p["ablation"]["sampling"]["draws"].pop("pcrdiffusion_cb"),
        "ablation.sampling.draws needs a number for pcrdiffusion_cb, has ['pcrdiffusion_cf']"),
    "noise on what is not trained": (
        lambda p: (
            p["ablation"]["noise"].update(methods=["pcrnet"]),
            p["trainings"]["pcrnet"].pop("modelnet40-gaussian_noise"),
        ),
        "ablation.noise.methods needs trainings.pcrnet.modelnet40-gaussian_noise, which is not "),
    "an ablation over nothing": (lambda p: p["ablation"].update(representations=[]),
        "ablation.representations: List should have at least 1 item"),
    "a representation that is not the networks' own": (
        lambda p: p["ablation"].update(representations=["euler"]),
        "ablation.representations needs methods.pcrdiffusion_cf.network.representation among them, "),
    "a scaling that is not the networks' own": (
        lambda p: p["ablation"].update(scalings=["standardised"]),
        "ablation.scalings needs methods.pcrdiffusion_cf.network.scaling among them, which is raw"),
    "a variant that is the method as it is": (
        lambda p: p["ablation"]["diffusions"].append("with"),
        "ablation.diffusions needs others than methods.pcrdiffusion_cf.network.diffusion, which is w"),
    "a fusion that is the method's own": (lambda p: p["ablation"]["fusions"].append("source"),
        "ablation.fusions needs others than methods.pcrdiffusion_cf.network.fusion, which is source"),
    "an unknown representation": (
        lambda p: p["ablation"].update(representations=["quaternion", "axis"]),
        "ablation.representations.1: Input should be 'quaternion', 'euler', 'rotation_6d', "),
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


@pytest.mark.parametrize(
    "keys",
    [
        ("run", "scenarios"),
        ("run", "classical"),
        ("run", "diffused"),
        ("run", "baselines"),
        ("ablation", "methods"),
        ("ablation", "representations"),
        ("ablation", "fusions"),
        ("ablation", "steps"),
        ("ablation", "hypotheses"),
        ("ablation", "sampling", "samplers"),
        ("ablation", "diffusions"),
        ("ablation", "noise", "deviations"),
    ],
)
def test_refuses_a_list_that_names_the_same_twice(tmp_path: Path, keys: tuple[str, ...]) -> None:
    def double(params: dict[str, Any]) -> None:
        entries: Any = params
        for key in keys:
            entries = entries[key]
        entries.append(entries[0])

    said = sentence(tmp_path, double)
    assert said.startswith(f"{'.'.join(keys)}: a list needs each of its entries once, has ")


def test_equal_numbers_are_the_same_entry_however_they_are_written(tmp_path: Path) -> None:
    said = sentence(tmp_path, lambda p: p["ablation"]["noise"]["deviations"].append(0))
    assert "noise.deviations: a list needs each of its entries once, has 0.0 again" in said


RULE = "a name needs 1 to 64 of A-Z, a-z, 0-9, _ and -, a letter among them, the first no _ or -"


def rename(params: dict[str, Any], section: str, old: str, new: str) -> None:
    """Give a data set or a scenario another name, wherever it is named."""
    params[section] = {new if k == old else k: value for k, value in params[section].items()}
    for scenario in params["scenarios"].values():
        if section == "acquire" and scenario["dataset"] == old:
            scenario["dataset"] = new
    if section == "scenarios":
        for key in ("scenarios", "trained"):
            names = params["run"][key]
            params["run"][key] = [new if name == old else name for name in names]
        for epochs in params["trainings"].values():
            epochs[new] = epochs.pop(old)


@pytest.mark.parametrize("section", ["acquire", "scenarios"])
@pytest.mark.parametrize(
    "name",
    ["model_v1.0", "a b", "it's", "..", ".", "", "-x", "--help", "_x", "a/b", "a\\b", "a@b",
     "a:b", "a,b", "a#", "$(x)", "${a}", "a*", "café", "数据", "a\nb", "a\n", "x" * 65, "12"],
)  # fmt: skip
def test_refuses_a_name_that_breaks_a_path_or_a_command(
    tmp_path: Path, section: str, name: str
) -> None:
    said = sentence(tmp_path, lambda p: rename(p, section, "kitti", name))
    assert said.startswith(f"{section}.{' '.join(name.split())}")
    assert f": {RULE}, got " in said


@pytest.mark.parametrize("section", ["acquire", "scenarios"])
def test_refuses_names_that_differ_in_case_only(tmp_path: Path, section: str) -> None:
    said = sentence(tmp_path, lambda p: rename(p, section, "kitti", "3DMatch"))
    assert f"{section} has '3dmatch' and '3DMatch', which differ in case only" in said


@pytest.mark.parametrize("section", ["acquire", "scenarios"])
@pytest.mark.parametrize("name", ["x", "3d", "2026-11-a_b", "Kitti", "x" * 64])
def test_accepts_a_name_that_fits_everywhere(tmp_path: Path, section: str, name: str) -> None:
    params = read_repository_params()
    rename(params, section, "kitti", name)
    write_yaml(tmp_path / "params.yaml", params)
    assert name in getattr(read_params(tmp_path / "params.yaml"), section)


def numbers(values: Any, *keys: Any) -> Iterator[tuple[Any, ...]]:  # noqa: ANN401  YAML
    """The keys that lead to each number."""
    if isinstance(values, dict | list):
        entries = values.items() if isinstance(values, dict) else enumerate(values)
        for key, value in entries:
            yield from numbers(value, *keys, key)
    elif isinstance(values, int | float):
        yield keys


@pytest.mark.parametrize("number", [float("inf"), float("-inf"), float("nan"), 10**12, 2**128])
def test_no_number_is_without_bounds(number: float) -> None:
    params = read_repository_params()
    for *outer, last in list(numbers(params)):
        if outer == [] and last == "seed" and number == 10**12:
            continue
        place: Any = params
        for key in outer:
            place = place[key]
        kept, place[last] = place[last], number
        with pytest.raises(ValidationError) as refused:
            Params.model_validate(params)
        place[last] = kept
        first = refused.value.errors()[0]
        inside = ("epochs",) if outer[:1] == ["trainings"] else ()  # which an integer stands for
        assert first["loc"] == (*outer, last, *inside)
        assert first["msg"].startswith("Input should be ")


LARGE: dict[str, tuple[Change, str]] = {
    "a seed of 128 bits": (lambda p: p.update(seed=2**127),
        f"seed: Input should be less than {2**63}, got {2**127}"),
    "an infinite length": (lambda p: p["scenarios"]["kitti"].update(max_translation=float("inf")),
        "scenarios.kitti.max_translation: Input should be a finite number, got inf"),
    "more points than there is room for": (
        lambda p: p["scenarios"]["kitti"].update(num_points=10**12),
        f"scenarios.kitti.num_points: Input should be less than or equal to {10**9}, got {10**12}"),
    "more threads than any machine has": (lambda p: p.update(threads=10**6),
        "threads: Input should be less than or equal to 10000, got 1000000"),
    "a long list": (lambda p: p.update(seed=[0] * 10**4), "got [0, 0, 0, 0, 0, 0, ...]"),
    "a long text": (lambda p: p.update(seed="x" * 10**4), "got 'xxx"),
}  # fmt: skip


@pytest.mark.parametrize("name", LARGE)
def test_refuses_what_is_too_large(tmp_path: Path, name: str) -> None:
    change, expected = LARGE[name]
    said = sentence(tmp_path, change)
    assert expected in said
    assert len(said) < 400


def test_refuses_a_number_that_python_does_not_write_out(tmp_path: Path) -> None:
    path = tmp_path / "params.yaml"
    text = (REPOSITORY / "params.yaml").read_text()
    path.write_text(text.replace("seed: 7", f"seed: 0x{'f' * 5000}"))
    with pytest.raises(ValueError, match=r"params\.yaml: seed: Input should be"):
        read_params(path)


def test_the_largest_seed_is_accepted(tmp_path: Path) -> None:
    write_yaml(tmp_path / "params.yaml", read_repository_params() | {"seed": 2**63 - 1})
    assert read_params(tmp_path / "params.yaml").seed == 2**63 - 1


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
