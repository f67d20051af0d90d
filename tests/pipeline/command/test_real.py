"""`pcrdiff real`: where the real data lies reaches params.yaml as it was told."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from dvc.cli import parse_args
from dvc.utils.hydra import apply_overrides
from dvc.utils.serialize import load_yaml

from pipeline.command import real
from pipeline.command.estimate import Estimate
from pipeline.formats.yaml_files import read_yaml
from pipeline.settings.params import Params, read_params
from pipeline.settings.profiles import profile_values
from tests.described import REPOSITORY, write_yaml

ROOTS = {
    "modelnet40": "modelnet10_hdf5_1024",
    "modelnet40_off": "modelnet40_off",
    "modelnet40_normal_resampled": "modelnet40_normal_resampled",
    "3dmatch": "3dmatch",
    "kitti": "kitti",
}
FOLDERS = [
    "real data #1",
    "a: b",
    'it\'s "mine"',
    "{x}, [y]",
    "*all & !some",
    "- first",
    "5%@`|>",
    "back\\slash",
    "${seed}",
    "ünïcode 数据",
    "long " * 40,
]


MINE = "mine: 1\nacquire:\n  3dmatch:\n    root: here\n    old: true\n"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose DVC runs nothing and keeps what params.yaml would be in the experiment."""
    folder = tmp_path / "project"
    shutil.copytree(REPOSITORY / "profiles", folder / "profiles")
    (folder / "params.yaml").write_text(MINE)

    def seen(root: Path, *words: str, check: bool = True) -> None:
        if "run" in words and check:
            shutil.copy(root / "params.yaml", root / "seen.yaml")
            apply_overrides(root / "seen.yaml", set_params(words))

    monkeypatch.setattr(real, "_dvc", seen)
    monkeypatch.setattr(real, "check_experiments", lambda _root: None)
    monkeypatch.setattr(real, "_fetch", lambda _root: [])
    return folder


def set_params(words: Sequence[str]) -> list[str]:
    """What DVC's own command line makes of the words."""
    parsed = parse_args(list(words))
    assert (parsed.tmp_dir, parsed.name) == (True, real.NAME)
    changes: list[str] = parsed.set_param
    return changes


@pytest.mark.parametrize("name", FOLDERS)
def test_the_roots_lie_in_the_folder_that_was_told(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    folder = project.parent / name
    folder.mkdir()
    monkeypatch.setenv(real.VARIABLE, str(folder))
    real.run_real(project)
    read = read_params(project / "seen.yaml")
    roots = {name: acquire.root for name, acquire in read.acquire.items()}
    assert roots == {name: f"{folder}/{root}" for name, root in ROOTS.items()}
    assert load_yaml(project / "seen.yaml") == read_yaml(project / "seen.yaml")
    assert (project / "params.yaml").read_text() == MINE


def test_the_plan_is_of_the_profile_and_writes_nothing(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Params] = []

    def estimate(params: Params, root: Path) -> list[Estimate]:
        assert root == project
        seen.append(params)
        return [Estimate("some", "where", 1, 3600, 1.5)]

    monkeypatch.setattr("pipeline.command.estimate.estimate", estimate)
    monkeypatch.setenv(real.VARIABLE, str(project.parent))
    said = list(real.plan_real(project))
    assert [params.profile for params in seen] == ["real"]
    assert seen[0].acquire["kitti"].root == f"{project.parent}/{ROOTS['kitti']}"
    assert "Estimate, on this machine, one thread a training" in said[0]
    assert [line.split()[-1] for line in said[2:4]] == ["1.50", "1.50"]
    assert not (project / "seen.yaml").exists()


def test_nothing_but_the_roots_differs_from_the_profile(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(real.VARIABLE, str(project.parent))
    real.run_real(project)
    ours, theirs = profile_values(REPOSITORY, "real"), read_yaml(project / "seen.yaml")
    assert ours.pop("acquire") != theirs.pop("acquire")
    assert ours == theirs


@pytest.mark.parametrize("name", ["quick", "tables", "real", "paper"])
def test_any_profile_becomes_any_other_and_only_what_differs_is_set(
    tmp_path: Path, name: str
) -> None:
    path, before = tmp_path / "params.yaml", profile_values(REPOSITORY, name)
    for other in ("quick", "tables", "real", "paper"):
        wanted = profile_values(REPOSITORY, other)
        write_yaml(path, before)
        changes = real.overrides(before, wanted)[1::2]
        apply_overrides(path, changes)
        assert read_yaml(path) == wanted
        sections = {change.partition("=")[0].lstrip("+~") for change in changes}
        assert sections == {key for key in wanted if wanted[key] != before[key]}


@pytest.mark.parametrize(
    "value", ["", "06", "null", "true", "1e3", "a\\", "a\\\\", '\\"', "\\${x}", "x${", "[a]", None, 0.05,
              1e-05, 10**9, [], {}, [{"a": [None, "b,c"]}], {"3d": {"a-b": {}}}],
)  # fmt: skip
def test_a_value_is_set_as_it_is(tmp_path: Path, value: object) -> None:
    (tmp_path / "params.yaml").write_text("a: 1\nb: 2\n")
    apply_overrides(tmp_path / "params.yaml", real.overrides({"a": 1, "b": 2}, {"a": value})[1::2])
    assert read_yaml(tmp_path / "params.yaml") == {"a": value}


def test_params_that_are_no_mapping_are_refused(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (project / "params.yaml").write_text("- 1\n")
    monkeypatch.setenv(real.VARIABLE, str(project.parent))
    with pytest.raises(ValueError, match=r"params\.yaml needs to be a mapping, got list"):
        real.run_real(project)


@pytest.mark.parametrize("name", ["two\nlines", "tab\there", "no text \udcff"])
def test_refuses_a_folder_that_yaml_cannot_hold(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    folder = project.parent / name
    folder.mkdir()
    monkeypatch.setenv(real.VARIABLE, str(folder))
    with pytest.raises(ValueError, match="PCRDIFF_REAL_DATA needs the path in printable"):
        real.run_real(project)
    assert (project / "params.yaml").read_text() == MINE
