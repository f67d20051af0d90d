"""No stage loads what it does not use: a second of each start, fifty times."""

import json
import subprocess
import sys

import pytest

from tests.tiny import instance, project  # noqa: F401  a fixture

SLOW = {
    "dask", "distributed", "dvc", "joblib", "lightning_fabric", "matplotlib", "mlflow", "open3d",
    "pandas", "plotly", "sklearn",
}  # fmt: skip
"""Packages that take a good part of a second to load."""


def loaded_by(name: str) -> set[str]:
    """The slow packages that a stage of the tiny project has loaded when it ends."""
    stage = instance(name)
    code = (
        f"import json, sys\nfrom {stage.module} import main\nmain({stage.argv!r})\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.PIPE)
    return {module.split(".")[0] for module in json.loads(done.stdout.splitlines()[-1])} & SLOW


@pytest.mark.slow
@pytest.mark.usefixtures("project")
@pytest.mark.parametrize(
    ("name", "used"),
    [
        ("preprocess@modelnet40-unseen_objects", set()),
        ("train@modelnet40-unseen_objects-pcrdiffusion_cf", set()),
        ("evaluate@pcrdiffusion_cb", set()),
        ("evaluate_baselines@rpmnet", set()),
        ("evaluate_classical@icp", {"open3d"}),
    ],
)
def test_a_stage_loads_only_what_it_uses(name: str, used: set[str]) -> None:
    by_itself = {"sklearn", "pandas", "matplotlib", "plotly", "joblib"}  # Open3D loads them
    assert loaded_by(name) - (by_itself if used else set()) == used
