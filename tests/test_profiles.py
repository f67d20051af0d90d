"""The profiles: valid, and what each promises; the quick one is what the repository runs."""

from typing import Any

import pytest

from pipeline.reporting.paper import METHODS, UNSEEN_OBJECTS
from pipeline.settings.params import MOVED, Params
from pipeline.settings.profiles import profile_names, profile_values, read_profile
from tests.described import REPOSITORY, read_repository_params

PROFILES = ("quick", "tables", "real", "weights", "paper")


FREE = (".trainings", ".methods", ".train")
"""Sections in which each profile has the methods that it runs."""


def differences(ours: Any, theirs: Any, path: str = "") -> list[str]:  # noqa: ANN401  YAML
    """The dotted keys that one of two has alone; a section may be null, if the params let it."""
    if path in FREE:
        return []
    if ours is None or theirs is None or not isinstance(ours, dict | list):
        return [] if not isinstance(theirs, dict | list) or ours is None else [path]
    if isinstance(ours, list) or not isinstance(theirs, dict):
        return [] if type(ours) is type(theirs) else [path]
    alone = [f"{path}.{key}" for key in ours.keys() ^ theirs.keys()]
    both = ours.keys() & theirs.keys()
    return alone + [d for k in both for d in differences(ours[k], theirs[k], f"{path}.{k}")]


def load(name: str) -> dict[str, Any]:
    return profile_values(REPOSITORY, name)


def test_the_repository_runs_the_quick_profile() -> None:
    assert (REPOSITORY / "params.yaml").read_bytes() == (
        REPOSITORY / "profiles" / "quick.yaml"
    ).read_bytes()


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_is_valid_and_says_its_own_name(name: str) -> None:
    assert read_profile(REPOSITORY, name).profile == name


def test_there_are_no_profiles_but_these() -> None:
    assert profile_names(REPOSITORY) == sorted(PROFILES)


@pytest.mark.parametrize("name", ["quick", "tables", "paper"])
def test_a_profile_has_the_keys_of_params_yaml(name: str) -> None:
    assert differences(read_repository_params(), load(name)) == []


@pytest.mark.parametrize("name", ["quick", "tables", "paper"])
def test_a_profile_has_sections_of_the_methods_that_it_runs_and_of_no_others(name: str) -> None:
    params = load(name)
    learned = {*params["run"]["diffused"], *params["run"]["baselines"]}
    run = params["run"]
    sources = params["ablation"]["starts"]["sources"]
    named = {*run["classical"], *run["shipped"], *sources}
    assert params["methods"].keys() == learned | named
    assert params["train"].keys() - {"devices", "nodes", "poses"} == learned
    assert params["trainings"].keys() == learned
    quick = read_repository_params()
    for method in learned & quick["train"].keys():
        assert differences(quick["train"][method], params["train"][method]) == []
        ours, theirs = (each["methods"][method]["network"] for each in (quick, params))
        assert differences(ours, theirs) == []


def test_a_missing_an_extra_and_a_moved_key_are_seen() -> None:
    ours, theirs = load("quick"), load("quick")
    del theirs["ablation"]["walk"]["steps"]
    theirs["diffusion"]["stepps"] = 1
    theirs["seed"] = {"all": 7}
    assert sorted(differences(ours, theirs)) == [
        ".ablation.walk.steps",
        ".diffusion.stepps",
        ".seed",
    ]


def test_the_profiles_differ_in_more_than_their_names() -> None:
    contents = [load(name) | {"profile": ""} for name in PROFILES]
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


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("method", UPDATES)
def test_the_settings_are_the_papers_counts_and_the_authors_own(name: str, method: str) -> None:
    key, paper, official = UPDATES[method]
    section = load(name)["methods"].get(method)
    if section is None:
        assert name == "quick"  # which does not run it
        return
    settings = section.get("settings", section)
    assert settings["paper"][key] == paper
    own = None if name == "quick" else official
    assert settings.get("official", {}).get(key) == own


def test_the_authors_own_settings_are_the_libraries_defaults() -> None:
    from pcrdiff.bindings.open3d_registration import registration

    methods = load("tables")["methods"]
    rounds = registration.ICPConvergenceCriteria().max_iteration
    assert methods["icp"]["official"]["max_iterations"] == rounds
    assert methods["gicp"]["official"]["max_iterations"] == rounds
    iterations = registration.FastGlobalRegistrationOption().iteration_number
    assert methods["fgr"]["official"]["iterations"] == iterations


def trained_on(scenario: str, params: Params) -> set[str]:
    return {method for method, epochs in params.trainings.items() if scenario in epochs}


@pytest.mark.parametrize("name", ["tables", "real", "paper"])
def test_every_method_is_run_or_trained_on_unseen_objects(name: str) -> None:
    params = read_profile(REPOSITORY, name)
    methods = {*params.run.diffused, *params.run.baselines}
    assert trained_on(UNSEEN_OBJECTS, params) == methods - {*MOVED}
    shipped_and_sources = {*params.run.shipped, *params.ablation.starts.sources}
    left_out = {"trimmed_icp"} if name == "real" else set()  # over a second a pair
    assert {*params.run.classical, *shipped_and_sources} | methods == METHODS.keys() - left_out


def test_quick_trains_the_diffused_methods_and_what_they_are_built_on_for_every_scenario() -> None:
    params = read_profile(REPOSITORY, "quick")
    for scenario in params.run.trained:
        needed = {"pcrdiffusion_cf", "pcrdiffusion_cb", "pcrnet", "rpmnet"}
        assert trained_on(scenario, params) == needed
    floors_and_others = {"identity", "constant", "icp_centroid", "icp", "fgr", "ransac_fpfh"}
    floors_and_others |= {"gicp_multistart", "sc2_pcr"}
    assert {*params.run.classical} == floors_and_others


@pytest.mark.parametrize("name", ["tables", "paper"])
def test_a_list_of_an_ablation_has_quicks_entries_and_more(name: str) -> None:
    quick, theirs = load("quick")["ablation"], load(name)["ablation"]
    longer = {key for key, value in quick.items() if theirs[key] != value and key != "epochs"}
    assert {"representations", "scalings", "fusions", "steps"} <= longer
    for key in longer - {"sampling", "noise"}:
        assert {*quick[key]} < {*theirs[key]}
    for key in ("methods", "deviations"):
        assert {*quick["noise"][key]} < {*theirs["noise"][key]}
