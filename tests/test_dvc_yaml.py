"""dvc.yaml tells DVC the truth: about the code, the params and the paths of each stage."""

import copy
import importlib
import os
import re
import shutil
import subprocess
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import grimp
import pytest
from dvc.fs import localfs
from dvc.ignore import DvcIgnoreFilter
from ruamel.yaml import YAML

from pipeline.formats.weights import SHIPPED_FOLDER
from pipeline.formats.yaml_files import read_yaml
from pipeline.settings.params import classical_names, read_params
from pipeline.settings.profiles import profile_values
from pipeline.settings.variants import FUSED
from pipeline.tracking.journal import content_md5
from tests.described import (
    REPOSITORY,
    VARIABLE,
    Instance,
    expand,
    flow_style_lists,
    read_templates,
)
from tests.recording import Reads, RecordingSection
from tests.tiny import (
    lay_out,
    run_instance,
    standing_in,
    tiny_params,
    with_refined_walks,
    write_params,
)

GLUE = {
    "pcrdiff.training.ranks": "says what several processes share; tests hold that they learn the same",
    "pcrdiff.loops": "watches loops and lets them be run elsewhere; says nothing of what they do",
    "pipeline.formats.answers": "writes files; its tests hold their bytes",
    "pipeline.formats.files": "writes and reads files; its tests hold their bytes",
    "pipeline.formats.pairs": "writes and reads files; its tests hold their bytes",
    "pipeline.formats.verdicts": "writes and reads files; its tests hold what they say",
    "pipeline.formats.weights": "writes and reads files; its tests hold their bytes",
    "pipeline.answering": "hands pairs and seeds to pcrdiff.evaluation; its tests hold the seeds",
    "pipeline.judging": "hands answers to pcrdiff.verdict; its tests hold what is fitted to which",
    "pipeline.loading": "hands params to methods; a new method must not retrain the old ones",
    "pipeline.compute.checkpoints": "keeps what a training gives it, and gives it back",
    "pipeline.tracking.run": "finds the project and names the run",
    "pipeline.compute.machine": "sets threads and precision as params say",
    "pipeline.tracking.mlflow_runs": "says what a run in MLflow holds",
    "pipeline.tracking.mlflow_store": "says where MLflow keeps its runs",
    "pipeline.tracking.mlflow_sync": "copies journals into MLflow after the report is written",
    "pipeline.settings.catalogue": "the part of pipeline.settings.params that is about methods",
    "pipeline.settings.sections": "what pipeline.settings.params is made of",
    "pipeline.settings.params": "hands over params.yaml, whose keys DVC watches by themselves",
    "pipeline.compute.ranks": "lets several processes train as one; tests hold that they learn the same",
    "pipeline.settings.profiles": "says what is usual, for MLflow to name what is not",
    "pipeline.compute.progress": "draws bars",
    "pipeline.tracking.records": "reads journals for MLflow",
    "pipeline.settings.seeding": "derives seeds; its test holds them",
    "pipeline.compute.workers": "runs loops elsewhere; tests hold that the results are the same bytes",
    "pipeline.tracking.restored": "tells MLflow what DVC took from its cache",
    "pipeline.tracking.journal": "writes journals",
    "pipeline.tracking.dvcignore": "says which files count for journals and checkpoints",
    "pipeline.settings.variants": "names what ablations vary",
    "pipeline.formats.walks": "writes and reads walks; its tests hold their bytes",
    "pipeline.formats.yaml_files": "reads params.yaml for pipeline.settings.params",
}
"""Modules that change no result, so that a change of theirs need not re-run a stage; and why."""
WIRING = {
    "pcrdiff.bindings.open3d_registration": "carries params into the methods that match features",
    "pcrdiff.diffusion.sampling": "`Walk` carries params into the learned methods, which import it",
    "pcrdiff.hypotheses": "`Refinement` carries params into the methods that refine, which import it",
    "pcrdiff.models.refined_walks": "what a setting `refined` makes of a trained method",
}
"""What ``pipeline.loading`` imports for some methods only."""
REFINING = ("evaluate", "evaluate_baselines", "evaluate_shipped")
"""The stages whose learned methods may have a setting ``refined``."""
PLACE = {
    "compute": "where work is done: tests hold that the results are the same bytes",
}
"""Params that change no result, so that no stage declares them; and why."""
COMMITTED = {
    "benchmarks": "tables of `make bench`, measured by hand on one machine: no stage makes them",
}
"""Inputs that lie in the repository, and why."""
CODE = ("pcrdiff/", "pipeline/", "stages/")
NAMES = ("--dataset", "--scenario", "--method", "--ablation", "--value")
"""The options whose values are names, not paths."""

TEMPLATES = read_templates()
TABLES = profile_values(REPOSITORY, "tables")
INSTANCES = expand(TABLES)
IMPORTS = grimp.build_graph(
    "pcrdiff", "pipeline", "stages", exclude_type_checking_imports=True, cache_dir=None
)


def by_name(instances: list[Instance]) -> dict[str, Instance]:
    return {instance.name: instance for instance in instances}


def methods_of(instance: Instance) -> list[str]:
    """The methods that an instance builds."""
    if "method" in instance.item:
        return [instance.item["method"]]
    if instance.template == "train_fusion":
        return [*FUSED]
    run = TABLES["run"]
    others = [*run["baselines"], *run["classical"]] if instance.template == "time" else []
    return [*run["diffused"], *others]


def imported_modules(instance: Instance) -> set[str]:
    """What an instance imports of this project, with the methods that the catalogue builds for it."""
    graph = copy.deepcopy(IMPORTS)
    for module in WIRING:
        graph.remove_import(importer="pipeline.loading", imported=module)
    if "pipeline.loading" in graph.find_upstream_modules(instance.module):
        for method in methods_of(instance):
            imported = f"pcrdiff.methods.{method}"
            graph.add_import(importer="pipeline.loading", imported=imported)
    if instance.template in REFINING:
        refined = "pcrdiff.models.refined_walks"
        graph.add_import(importer="pipeline.loading", imported=refined)
    return set(graph.find_upstream_modules(instance.module)) | {instance.module}


def file_of(module: str) -> Path:
    path = Path(*module.split("."))
    return path / "__init__.py" if (REPOSITORY / path).is_dir() else path.with_suffix(".py")


def lies_in(module: str, dep: str) -> bool:
    return file_of(module).is_relative_to(dep)


# Code.


@pytest.mark.parametrize("name", by_name(INSTANCES))
def test_deps_cover_every_imported_module(name: str) -> None:
    instance = by_name(INSTANCES)[name]
    missing = {
        file_of(module).as_posix()
        for module in imported_modules(instance) - GLUE.keys()
        if file_of(module).name != "__init__.py"
        and not any(lies_in(module, dep) for dep in instance.deps)
    }
    assert not missing, f"{name} imports what its deps do not name: {sorted(missing)}"


@pytest.mark.parametrize("template", TEMPLATES)
def test_no_dep_is_code_that_the_stage_does_not_import(template: str) -> None:
    instances = [instance for instance in INSTANCES if instance.template == template]
    modules = set().union(*map(imported_modules, instances))
    deps = {dep for instance in instances for dep in instance.deps if dep.startswith(CODE)}
    deps -= {dep for dep in deps if dep.startswith("pcrdiff/weights")}  # which hold no code
    assert deps
    stale = {dep for dep in deps if not any(lies_in(module, dep) for module in modules)}
    assert not stale, f"{template} depends on what it does not import: {sorted(stale)}"


@pytest.mark.parametrize("name", by_name(INSTANCES))
def test_every_dep_that_is_code_exists(name: str) -> None:
    code = [dep for dep in by_name(INSTANCES)[name].deps if dep.startswith(CODE)]
    assert [dep for dep in code if not (REPOSITORY / dep).exists()] == []


def test_every_excuse_is_needed() -> None:
    reached = set().union(*map(imported_modules, INSTANCES))
    assert GLUE.keys() <= reached
    wired = IMPORTS.find_modules_directly_imported_by("pipeline.loading")
    assert WIRING.keys() <= wired


@pytest.mark.parametrize(
    "template", ["train", "train_baselines", "train_fusion", "evaluate", "evaluate_baselines"]
)
def test_a_learned_method_depends_on_its_own_file_alone(template: str) -> None:
    for instance in INSTANCES:
        if instance.template == template:
            methods = {dep for dep in instance.deps if dep.startswith("pcrdiff/methods")}
            assert methods == {f"pcrdiff/methods/{name}.py" for name in methods_of(instance)}


# Params.


def null_journal(**_: object) -> AbstractContextManager[MagicMock]:
    """Takes what a journal is told, and reads nothing of it."""
    return nullcontext(MagicMock())


def everything() -> dict[str, Any]:
    """The tiny project's params with every classical method, and walks that are refined."""
    params = with_refined_walks(tiny_params())
    params["run"]["classical"] = classical_names()
    return params


@pytest.fixture(scope="module")
def reads(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reads]:
    """Which params each stage of the tiny project reads: all are run, in the order of dvc.yaml."""
    folder = tmp_path_factory.mktemp("recorded") / "project"
    lay_out(folder)
    read: dict[str, Reads] = {}
    with standing_in(folder), pytest.MonkeyPatch.context() as patch:
        write_params(everything())
        for instance in expand(everything()):
            module = importlib.import_module(instance.module)
            read[instance.name] = set()
            params = RecordingSection(read_params(), "", read[instance.name])
            patch.setattr(module, "read_params", lambda params=params: params)
            patch.setattr(module, "journal", null_journal)
            if instance.template == "report":
                patch.setattr(module, "sync_after_report", MagicMock())
            run_instance(instance)
    return read


def lies_under(key: str, section: str) -> bool:
    return key == section or key.startswith(f"{section}.")


TINY = by_name(expand(everything()))


@pytest.mark.parametrize("name", TINY)
def test_every_param_that_is_read_is_declared(reads: dict[str, Reads], name: str) -> None:
    declared = [*TINY[name].content["params"], *PLACE]
    missing = {key for key in reads[name] if not any(lies_under(key, d) for d in declared)}
    assert not missing, f"{name} reads params that dvc.yaml does not name: {sorted(missing)}"


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_param_that_is_declared_is_read_or_names_a_path(
    reads: dict[str, Reads], template: str
) -> None:
    instances = [instance for instance in TINY.values() if instance.template == template]
    written = str(TEMPLATES[template])
    for place in range(len(instances[0].content["params"])):
        declared = {instance.name: instance.content["params"][place] for instance in instances}
        is_read = any(lies_under(r, key) for name, key in declared.items() for r in reads[name])
        is_named = bool({*declared.values()} & {*VARIABLE.findall(written)})
        assert is_read or is_named, f"{template} declares {declared} and reads none of it"


def test_no_stage_declares_where_its_work_is_done_though_some_read_it(
    reads: dict[str, Reads],
) -> None:
    declared = {key for instance in INSTANCES for key in instance.content["params"]}
    assert not {key for key in declared if any(lies_under(key, place) for place in PLACE)}
    read = set().union(*reads.values())
    assert all(any(lies_under(key, place) for key in read) for place in PLACE)


def test_the_recording_sees_what_is_read(reads: dict[str, Reads]) -> None:
    assert {"seed", "threads", "diffusion.timesteps", "train.pcrdiffusion_cf.batch_size"} <= reads[
        "train@modelnet40-unseen_objects-pcrdiffusion_cf"
    ]
    assert (
        "scenarios.modelnet40-unseen_objects.max_rotation_deg"
        in (reads["preprocess@modelnet40-unseen_objects"])
    )


def test_the_steps_of_the_walk_concern_only_what_samples() -> None:
    concerned = {
        instance.name
        for instance in INSTANCES
        if any(lies_under("diffusion.steps", key) for key in instance.content["params"])
    }
    evaluated = {f"evaluate@{method}" for method in TABLES["run"]["diffused"]}
    noisy = {f"ablate_noise@{method}" for method in TABLES["ablation"]["noise"]["methods"]}
    shipped = {f"evaluate_shipped@{method}" for method in TABLES["run"]["shipped"]}
    starts = {f"ablate_starts@{name}" for name in TABLES["ablation"]["starts"]["scenarios"]}
    assert concerned == {*evaluated, *noisy, *shipped, *starts, "ablate", "time"}


def test_every_declared_param_exists() -> None:
    params = TABLES
    for instance in INSTANCES:
        for key in instance.content["params"]:
            value = params
            for part in key.split("."):
                assert part in value, f"{instance.name} declares {key}, params.yaml has none"
                value = value[part]


# Paths.


def paths_of(instance: Instance) -> list[str]:
    """What the command is given, names apart."""
    paths, option = [], ""
    for word in instance.argv:
        if word.startswith("--"):
            option = word
        elif option not in NAMES:
            paths.append(word)
    return paths


@pytest.mark.parametrize("name", by_name(INSTANCES))
def test_every_path_of_a_command_is_a_dep_or_an_out_or_holds_one(name: str) -> None:
    instance = by_name(INSTANCES)[name]
    known, paths = [*instance.deps, *instance.outs], paths_of(instance)
    assert [path for path in paths if not any(Path(k).is_relative_to(path) for k in known)] == []
    assert [out for out in instance.outs if out not in paths] == []


@pytest.mark.parametrize("name", by_name(INSTANCES))
def test_every_dep_that_is_no_code_is_in_the_command_and_made_by_another_stage(name: str) -> None:
    instance = by_name(INSTANCES)[name]
    data = [dep for dep in instance.deps if not dep.startswith(CODE)]
    given = paths_of(instance)
    assert [dep for dep in data if not any(Path(dep).is_relative_to(path) for path in given)] == []
    made = {out for each in INSTANCES for out in each.outs} | COMMITTED.keys()
    assert [dep for dep in data if not any(Path(out).is_relative_to(dep) for out in made)] == []


def test_a_committed_input_is_there_and_its_code_is_not_seen_by_dvc() -> None:
    ignored = DvcIgnoreFilter(localfs, str(REPOSITORY))
    for folder in COMMITTED:
        code = list((REPOSITORY / folder).rglob("*.py"))
        assert code
        assert all(ignored.check_ignore(str(path)).match for path in code)


def test_a_command_runs_the_file_it_depends_on() -> None:
    for instance in INSTANCES:
        assert f"{instance.module.replace('.', '/')}.py" in instance.deps


@pytest.mark.parametrize("name", by_name(INSTANCES))
def test_a_command_has_nothing_that_two_shells_read_differently(name: str) -> None:
    command = by_name(INSTANCES)[name].content["cmd"].strip()
    assert re.fullmatch(r"sh stages/run [\w ./,+-]+", command)


SHELLS = {"sh": [], "bash": [], "dash": [], "zsh": [], "ksh": [], "tcsh": ["-f"], "fish": []}


@pytest.mark.parametrize("shell", [name for name in SHELLS if shutil.which(name)])
def test_a_command_runs_the_python_of_the_project_in_every_shell_here(
    tmp_path: Path, shell: str
) -> None:
    bin_folder = tmp_path / "a b's" / ".venv" / "bin"
    bin_folder.mkdir(parents=True)
    (bin_folder / "python").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    (bin_folder / "python").chmod(0o755)
    instance = INSTANCES[0]
    done = subprocess.run(
        [shell, *SHELLS[shell], "-c", instance.content["cmd"]],
        cwd=REPOSITORY,
        env={**os.environ, "DVC_ROOT": str(tmp_path / "a b's"), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == ["-m", "stages", *instance.content["cmd"].split()[2:]]


def test_no_two_stages_write_one_path() -> None:
    outs = [out for instance in INSTANCES for out in instance.outs]
    assert len(outs) == len(set(outs))


# Artifacts.


def test_every_network_that_is_shipped_is_an_artifact_and_has_a_card() -> None:
    artifacts = read_yaml(REPOSITORY / "dvc.yaml")["artifacts"]
    paths = [found["path"] for found in artifacts.values()]
    shipped = [*(REPOSITORY / SHIPPED_FOLDER).glob("*/*.safetensors")]
    assert shipped
    assert {path for path in paths if path.startswith(f"{SHIPPED_FOLDER.as_posix()}/")} == {
        path.relative_to(REPOSITORY).as_posix() for path in shipped
    }
    assert len({*paths}) == len(paths)
    assert [path for path in shipped if not path.with_suffix(".md").is_file()] == []


# params.yaml and DVC's ``-S``.


@pytest.mark.parametrize("name", ["params.yaml", "profiles/quick.yaml"])
def test_lists_are_in_block_style(name: str) -> None:
    node = YAML(pure=True).compose(REPOSITORY / name)
    assert [str(found.start_mark) for found in flow_style_lists(node)] == []


def test_lists_in_flow_style_are_found_where_there_are_some() -> None:
    text = "a: [1]\nb: []\nc: {d: {}, e: [2]}\nf:\n- 3\n"
    assert len(flow_style_lists(YAML(pure=True).compose(text))) == 2


def test_setting_a_param_by_dvc_changes_its_line_alone(tmp_path: Path) -> None:
    from dvc.utils.hydra import apply_overrides

    shutil.copy(REPOSITORY / "params.yaml", tmp_path)
    before = (tmp_path / "params.yaml").read_text().splitlines()
    apply_overrides(tmp_path / "params.yaml", ["diffusion.steps=4"])
    after = (tmp_path / "params.yaml").read_text().splitlines()
    changed = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert [re.sub(r"\s*#.*", "", line) for _, line in changed] == ["  steps: 4"]


def test_the_digest_of_a_dep_does_not_see_bytecode(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text("")
    before = content_md5(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_text("")
    assert content_md5(tmp_path) == before
    assert "__pycache__/" in (REPOSITORY / ".dvcignore").read_text().split()
