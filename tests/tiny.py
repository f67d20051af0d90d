"""A project so small that a test can run any stage of it: nine boxes and a dozen points each."""

import importlib
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml

from pipeline.compute.stage import run
from pipeline.settings.profiles import profile_values
from tests.described import REPOSITORY, Instance, expand, read_repository_params

SCENARIO = "modelnet40-unseen_objects"
CF, CB = "pcrdiffusion_cf", "pcrdiffusion_cb"


def weights(method: str) -> Path:
    """Where the weights of a method lie."""
    return Path("models", method, SCENARIO, "weights.safetensors")


PAIRS = Path(f"data/pairs/{SCENARIO}.h5")
RAW = Path("data/raw/modelnet40")
CATEGORIES = ("bed", "chair", "sofa")
CORNERS = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
SKIPPED = ("acquire@3dmatch", "acquire@kitti", "report")
"""Stages that a made project has not behind it."""


def tiny_params() -> dict[str, Any]:
    """The tables profile's params with one scenario of a local data set, and everything small."""
    params = profile_values(REPOSITORY, "tables")
    scenario = params["scenarios"][SCENARIO]
    scenario |= {"num_points": 48, "pairs": {"train": None, "val": None, "test": None}}
    scenario["split"]["val_fraction"] = 0.34
    params |= {"threads": 1, "scenarios": {SCENARIO: scenario}}
    params["compute"]["workers"] = 1
    params["run"] |= {"scenarios": [SCENARIO], "trained": [SCENARIO]}
    params["run"]["baselines"] = ["pcrnet", "rpmnet"]
    params["run"]["classical"] = read_repository_params()["run"]["classical"]
    params["run"]["shipped"] = [CF]
    params["trainings"] = {method: {SCENARIO: 3} for method in (CF, CB)}
    params["trainings"] |= {method: {SCENARIO: 1} for method in params["run"]["baselines"]}
    params["ablation"] |= {
        "epochs": {CF: 2, CB: 2},
        "diffusions": ["without"],
        "representations": ["quaternion", "twist"],
        "scalings": ["raw", "standardised"],
        "fusions": ["target", "concat"],
        "steps": [1, 2],
        "sampling": {"samplers": ["ddpm", "ddim"], "draws": {CF: 2, CB: 1}},
        "hypotheses": [1, 2],
        "walk": {"steps": 3, "pairs": 2},
        "noise": {"scenario": SCENARIO, "methods": ["identity", CF], "deviations": [0.0, 0.02]},
        "starts": {
            "scenarios": [SCENARIO],
            "pairs": 2,
            "counts": [1, 2],
            "sources": {"gicp_multistart": ["official"]},
        },
    }
    params["timing"] |= {"pairs": 2, "warm_up": 1, "starts": SCENARIO}
    acquire = params["acquire"]
    acquire["modelnet40"] |= {"source": "local", "root": "boxes", "synthetic": None}
    acquire["3dmatch"]["synthetic"] = {
        "scenes": 1,
        "fragments_per_scene": 1,
        "frames_per_fragment": 1,
    }
    acquire["kitti"]["synthetic"] = {"sequences": 1, "scans_per_sequence": 1}
    params["diffusion"]["timesteps"] = 20
    params["methods"][CF]["network"]["feature_dim"] = 16
    params["methods"][CB]["network"] |= {
        "feature_dim": 8,
        "neighbours": 4,
        "sinkhorn_iterations": 2,
    }
    params["methods"]["pcrnet"]["network"] |= {"feature_dim": 16, "probes": 8}
    params["methods"]["rpmnet"]["network"] |= {"feature_dim": 8, "neighbours": 4}
    for method in params["trainings"]:
        params["train"][method] |= {"batch_size": 4, "validate_every": 1}
    return params


def with_refined_walks(params: dict[str, Any]) -> dict[str, Any]:
    """The same params with a setting of CF that refines its walks, as a source of starts."""
    own = params["methods"]["gicp_multistart"]["official"]
    params["methods"][CF]["settings"]["refined"] = {"refined": own}
    params["ablation"]["starts"]["sources"][CF] = ["refined"]
    return params


def write_params(params: dict[str, Any]) -> None:
    """Write params.yaml into the project that is the current folder."""
    Path("params.yaml").write_text(yaml.safe_dump(params, sort_keys=False), encoding="utf-8")


def write_box(path: Path, sides: list[float]) -> None:
    """Write an ``.off`` box."""
    path.parent.mkdir(parents=True, exist_ok=True)
    vertices = [" ".join(map(str, corner)) for corner in (np.array(CORNERS) * sides).tolist()]
    faces = [f"4 {' '.join(map(str, face))}" for face in FACES]
    path.write_text("\n".join(["OFF", "8 6 0", *vertices, *faces, ""]))


def write_boxes(folder: Path) -> None:
    """Write a ModelNet of three categories with three training shapes and one test shape each."""
    generator = np.random.default_rng(5)
    for category in CATEGORIES:
        for number in range(1, 5):
            split = "train" if number < 4 else "test"
            path = folder / category / split / f"{category}_{number:04d}.off"
            write_box(path, generator.uniform(0.3, 1.0, 3).round(3).tolist())


def run_instance(instance: Instance) -> None:
    """Run a stage as dvc.yaml says, in this process."""
    stage_main(instance.module.removeprefix("stages."))(instance.argv)


def stage_main(name: str) -> Callable[[list[str]], None]:
    """The ``main`` of a stage."""
    main: Callable[[list[str]], None] = importlib.import_module(f"stages.{name}").main
    return main


def instance(name: str) -> Instance:
    """A stage of the tiny project, by the name DVC gives it."""
    (found,) = [each for each in expand(tiny_params()) if each.name == name]
    return found


def refusal(stage: str, argv: list[str]) -> str:
    """What a stage says as it ends; it has to end as one that refuses its input does."""

    def main() -> None:
        stage_main(stage)(argv)

    with pytest.raises(SystemExit) as stop:
        run(main, stage)
    said = stop.value.code
    assert isinstance(said, str), f"{stage} ended with exit code {said}"  # a str is exit code 1
    assert "\n" not in said
    return said


def files_below(folder: Path) -> list[str]:
    """The files below a folder, hidden ones too."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())


@contextmanager
def standing_in(folder: Path) -> Iterator[None]:
    """Make a folder the current one and DVC's root, and undo what stages do to torch."""
    with pytest.MonkeyPatch.context() as patch:
        for name in [name for name in os.environ if name.startswith("DVC_")]:
            patch.delenv(name)
        patch.setenv("DVC_ROOT", str(folder))
        patch.setattr("stages.time.in_a_child", lambda work: work())  # Open3D is loaded here
        patch.chdir(folder)
        yield
    torch.use_deterministic_algorithms(False)
    torch.set_flush_denormal(False)
    torch.set_num_threads(1)


def lay_out(folder: Path) -> None:
    """Write a project with nothing done: the code as links, params.yaml and the boxes."""
    folder.mkdir(parents=True, exist_ok=True)
    for code in ("pcrdiff", "pipeline", "stages"):
        (folder / code).symlink_to(REPOSITORY / code)
    with standing_in(folder):
        write_params(tiny_params())
    write_boxes(folder / "boxes")


@cache
def make_project(base: Path) -> Path:
    """A project with every stage done but the report; made once for all tests."""
    folder = base / "made-project"
    lay_out(folder)
    with standing_in(folder):
        for stage in expand(tiny_params()):
            if stage.name not in SKIPPED:
                run_instance(stage)
    return folder


@pytest.fixture
def blank(tmp_path: Path) -> Iterator[Path]:
    """A project with nothing done, as the current folder."""
    folder = tmp_path / "blank"
    lay_out(folder)
    with standing_in(folder):
        yield folder


@pytest.fixture
def project(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the made project, as the current folder."""
    folder = tmp_path / "project"
    shutil.copytree(make_project(tmp_path_factory.getbasetemp()), folder, symlinks=True)
    with standing_in(folder):
        yield folder
