"""The profiles: the same keys, other numbers; the quick one is what the repository runs."""

from pathlib import Path
from typing import Any

import pytest

from pipeline.params import read_params
from pipeline.reporting.paper import METHODS, UNSEEN_OBJECTS
from pipeline.yaml_files import read_yaml
from tests.described import REPOSITORY

PROFILES = ("quick", "cpu", "paper")


def profile(name: str) -> Path:
    return REPOSITORY / "profiles" / f"{name}.yaml"


def differences(ours: Any, theirs: Any, path: str = "") -> list[str]:  # noqa: ANN401  YAML
    """The dotted keys that one of two has alone; a section may be null, if the params let it."""
    if ours is None or theirs is None or not isinstance(ours, dict | list):
        return [] if not isinstance(theirs, dict | list) or ours is None else [path]
    if isinstance(ours, list) or not isinstance(theirs, dict):
        return [] if type(ours) is type(theirs) else [path]
    alone = [f"{path}.{key}" for key in ours.keys() ^ theirs.keys()]
    both = ours.keys() & theirs.keys()
    return alone + [d for k in both for d in differences(ours[k], theirs[k], f"{path}.{k}")]


def load(path: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = read_yaml(path)
    return loaded


def test_the_repository_runs_the_quick_profile() -> None:
    assert (REPOSITORY / "params.yaml").read_bytes() == profile("quick").read_bytes()


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_is_valid_and_says_its_own_name(name: str) -> None:
    assert read_params(profile(name)).profile == name


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_has_the_keys_of_params_yaml(name: str) -> None:
    ours, theirs = load(REPOSITORY / "params.yaml"), load(profile(name))
    assert differences(ours, theirs) == []


def test_a_missing_an_extra_and_a_moved_key_are_seen() -> None:
    ours, theirs = load(profile("quick")), load(profile("quick"))
    del theirs["train"]["pcrdiffusion_cf"]["patience"]
    theirs["diffusion"]["stepps"] = 1
    theirs["seed"] = {"all": 7}
    assert sorted(differences(ours, theirs)) == [
        ".diffusion.stepps",
        ".seed",
        ".train.pcrdiffusion_cf.patience",
    ]


def test_the_profiles_differ_in_more_than_their_names() -> None:
    contents = [load(profile(name)) | {"profile": ""} for name in PROFILES]
    assert all(a != b for k, a in enumerate(contents) for b in contents[k + 1 :])


UPDATES = {
    "icp": ("max_iterations", 10, 30),
    "pointnetlk": ("updates", 5, 20),
    "pcrnet": ("updates", 8, None),
    "fgr": ("iterations", 10, 64),
    "fmr": ("updates", 5, 10),
    "rpmnet": ("updates", 3, 5),
}
"""What Table 1 prints as "# Update P", and the authors' own; None where they agree."""


@pytest.mark.parametrize("name", [*PROFILES, "real"])
@pytest.mark.parametrize("method", UPDATES)
def test_the_settings_are_the_papers_counts_and_the_authors_own(name: str, method: str) -> None:
    key, paper, official = UPDATES[method]
    section = load(profile(name))["methods"][method]
    settings = section.get("settings", section)
    assert settings["paper"][key] == paper
    assert settings.get("official", {}).get(key) == official


def test_the_authors_own_settings_are_the_libraries_defaults() -> None:
    from pcrdiff.classical import registration

    methods = load(REPOSITORY / "params.yaml")["methods"]
    rounds = registration.ICPConvergenceCriteria().max_iteration
    assert methods["icp"]["official"]["max_iterations"] == rounds
    assert methods["gicp"]["official"]["max_iterations"] == rounds
    iterations = registration.FastGlobalRegistrationOption().iteration_number
    assert methods["fgr"]["official"]["iterations"] == iterations


@pytest.mark.parametrize("name", PROFILES)
def test_every_method_is_run_or_trained_on_unseen_objects(name: str) -> None:
    params = load(profile(name))
    trained = {t["method"] for t in params["trainings"].values() if t["scenario"] == UNSEEN_OBJECTS}
    assert {*params["run"]["classical"], *trained} == METHODS.keys()
