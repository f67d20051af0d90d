"""A profile is what differs from quick: merged, checked, and written with quick's comments."""

import re
import shutil
from pathlib import Path

import pytest
from dvc.utils.hydra import apply_overrides
from ruamel.yaml import YAML

from pipeline.formats.yaml_files import read_yaml
from pipeline.settings.profiles import profile_values, read_profile, write_profile
from tests.described import REPOSITORY, flow_style_lists

QUICK = REPOSITORY / "profiles" / "quick.yaml"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A project with the repository's profiles and without params.yaml."""
    shutil.copytree(REPOSITORY / "profiles", tmp_path / "profiles")
    return tmp_path


def mine(root: Path, text: str) -> Path:
    """Add the profile ``mine``."""
    path = root / "profiles" / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_mappings_are_merged_and_lists_and_other_values_replaced(root: Path) -> None:
    mine(
        root,
        "profile: mine\ndiffusion: {steps: 4}\nablation:\n  steps: [3]\n"
        "acquire:\n  kitti: {source: local, root: there, synthetic: null}\n"
        "  more: {family: kitti, source: local, root: x, archives: [], synthetic: null}\n",
    )
    expected = read_yaml(QUICK)
    expected["profile"] = "mine"
    expected["diffusion"]["steps"] = 4
    expected["ablation"]["steps"] = [3]
    expected["acquire"]["kitti"] |= {"source": "local", "root": "there", "synthetic": None}
    expected["acquire"]["more"] = expected["acquire"]["kitti"] | {"root": "x"}
    assert profile_values(root, "mine") == expected
    assert read_profile(root, "mine").acquire["kitti"].synthetic is None


def test_keys_of_quick_can_be_removed_and_a_section_so_replaced(root: Path) -> None:
    quick = read_yaml(QUICK)
    others = {name: epochs for name, epochs in quick["trainings"].items() if name != "rpmnet"}
    mine(
        root,
        "without: [trainings.rpmnet, trainings.pcrnet.kitti, ablation.sampling.draws]\n"
        "run: {baselines: [pcrnet]}\n"
        "ablation: {sampling: {draws: {pcrdiffusion_cb: 3, pcrdiffusion_cf: 5}}}\n",
    )
    values = profile_values(root, "mine")
    del others["pcrnet"]["kitti"]
    assert values["trainings"] == others
    assert values["ablation"]["sampling"]["draws"] == {"pcrdiffusion_cb": 3, "pcrdiffusion_cf": 5}
    assert values.keys() == quick.keys()


def test_a_profile_can_extend_another_than_quick(root: Path) -> None:
    mine(
        root, "extends: tables\nprofile: mine\nwithout: [trainings.egst]\nrun: {baselines: [fmr]}\n"
    )
    tables, values = profile_values(root, "tables"), profile_values(root, "mine")
    assert values["methods"] == tables["methods"] != read_yaml(QUICK)["methods"]
    assert values["trainings"] | {"egst": tables["trainings"]["egst"]} == tables["trainings"]
    assert values["run"] == tables["run"] | {"baselines": ["fmr"]}


def test_a_profile_that_leads_back_to_itself_is_refused(root: Path) -> None:
    mine(root, "extends: other\n")
    (root / "profiles" / "other.yaml").write_text("extends: mine\n")
    with pytest.raises(
        ValueError, match=r"mine\.yaml: extends needs another profile, it leads back"
    ):
        profile_values(root, "mine")


REFUSED = {
    "diffusion: {stepps: 4}": "diffusion.stepps: Extra inputs are not permitted, got 4",
    "diffusionn: {steps: 4}": "diffusionn: Extra inputs are not permitted",
    "diffusion: {steps: many}": "diffusion.steps: Input should be a valid integer, got 'many'",
    "diffusion: 4": "diffusion: Input should be a valid dictionary or instance of Diffusion, got 4",
    "seed: null": "seed: Input should be a valid integer, got None",
    "without: [diffusion.steps]": "diffusion.steps: Field required",
    "without: [diffusion.stepps]": "without needs keys of the profile it extends, got 'diffusion.stepps'",
    "without: [seed.of]": "without needs keys of the profile it extends, got 'seed.of'",
    "without: [7]": "without needs keys of the profile it extends, got '7'",
    "without: seed": "without needs a list of keys, got 'seed'",
    "without: null": "without needs a list of keys, got None",
}


def test_a_profile_that_extends_none_there_is_is_refused(root: Path) -> None:
    mine(root, "extends: tabels\n")
    with pytest.raises(FileNotFoundError, match=r"no profile 'tabels' in .*; there are: mine"):
        profile_values(root, "mine")


@pytest.mark.parametrize("text", REFUSED)
def test_a_profile_that_is_not_valid_is_refused_by_its_file_and_key(root: Path, text: str) -> None:
    path = mine(root, f"{text}\n")
    for refusing in (profile_values, read_profile):
        with pytest.raises(ValueError, match=re.escape(f"{path}: {REFUSED[text]}")) as refused:
            refusing(root, "mine")
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("text", "kind"), [("", "NoneType"), ("- 7\n", "list"), ("7\n", "int")])
def test_a_profile_that_is_no_mapping_is_refused(root: Path, text: str, kind: str) -> None:
    path = mine(root, text)
    with pytest.raises(ValueError, match=re.escape(f"{path} needs to be a mapping, got {kind}")):
        profile_values(root, "mine")


def test_a_profile_that_is_not_valid_leaves_params_as_they_are(root: Path) -> None:
    write_profile(root, "quick", force=False)
    mine(root, "seed: x\n")
    with pytest.raises(ValueError, match=r"mine\.yaml: seed"):
        write_profile(root, "mine", force=True)
    assert (root / "params.yaml").read_bytes() == QUICK.read_bytes()


def test_quick_is_written_byte_by_byte(root: Path) -> None:
    write_profile(root, "quick", force=False)
    assert (root / "params.yaml").read_bytes() == QUICK.read_bytes()


def comments(path: Path) -> set[str]:
    """The comments of a file beside its values."""
    return {found.strip() for found in re.findall(r"\S *(#.*)$", path.read_text(), re.MULTILINE)}


@pytest.mark.parametrize("name", ["tables", "paper"])
def test_the_comments_of_quick_are_kept_under_the_first_lines_of_the_profile(
    root: Path, name: str
) -> None:
    write_profile(root, name, force=False)
    assert comments(QUICK) <= comments(root / "params.yaml")
    first = (root / "profiles" / f"{name}.yaml").read_text().partition("\n\n")[0]
    assert (root / "params.yaml").read_text().startswith(f"{first}\nprofile: {name}\n")


@pytest.mark.parametrize("name", ["quick", "tables", "real", "paper"])
def test_what_is_written_are_the_values_and_dvc_rewrites_one_line_of_it(
    root: Path, name: str
) -> None:
    path = root / "params.yaml"
    write_profile(root, name, force=False)
    assert read_yaml(path) == profile_values(root, name)
    assert flow_style_lists(YAML(pure=True).compose(path)) == []
    before = path.read_text().splitlines()
    apply_overrides(path, ["diffusion.steps=4"])
    after = path.read_text().splitlines()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert len(changed) == 1


def test_a_list_with_a_comment_may_become_empty_before_another_list(root: Path) -> None:
    assert "  shipped:                      # networks" in QUICK.read_text()
    mine(root, "profile: mine\nrun: {shipped: []}\n")
    write_profile(root, "mine", force=False)
    text = (root / "params.yaml").read_text()
    assert read_yaml(root / "params.yaml") == profile_values(root, "mine")
    assert re.search(
        r"^  shipped: +\[\] +# networks .*\n  classical:\n  - identity$", text, re.MULTILINE
    )


def test_one_profile_may_follow_any_other(root: Path) -> None:
    for name in ("real", "quick", "paper", "tables", "real"):
        write_profile(root, name, force=False)
        assert write_profile(root, name, force=False) == []
