"""`pcrdiff real`: where the real data lies reaches params.yaml as it was told."""

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from pipeline import real
from pipeline.params import read_params
from tests.described import REPOSITORY

ROOTS = [
    "modelnet10_hdf5_1024",
    "modelnet40_off",
    "modelnet40_normal_resampled",
    "3dmatch",
    "kitti",
]
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


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose DVC runs nothing and keeps what params.yaml was."""
    folder = tmp_path / "project"
    (folder / "profiles").mkdir(parents=True)
    (folder / "params.yaml").write_text("mine: 1\n")
    profile = (REPOSITORY / "profiles" / "real.yaml").read_bytes()
    (folder / "profiles" / "real.yaml").write_bytes(profile)

    def seen(root: Path, *words: str, check: bool = True) -> None:
        if "run" in words and check:
            (root / "seen.yaml").write_bytes((root / "params.yaml").read_bytes())

    monkeypatch.setattr(real, "_dvc", seen)
    monkeypatch.setattr(real, "check_experiments", lambda _root: None)
    monkeypatch.setattr(real, "_fetch", lambda _root: [])
    return folder


@pytest.mark.parametrize("name", FOLDERS)
def test_the_roots_lie_in_the_folder_that_was_told(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    folder = project.parent / name
    folder.mkdir()
    monkeypatch.setenv(real.VARIABLE, str(folder))
    real.run_real(project)
    read = read_params(project / "seen.yaml")
    assert [acquire.root for acquire in read.acquire.values()] == [f"{folder}/{r}" for r in ROOTS]
    for_dvc = YAML(typ="safe").load((project / "seen.yaml").read_text())
    assert [a["root"] for a in for_dvc["acquire"].values()] == [f"{folder}/{r}" for r in ROOTS]
    assert (project / "params.yaml").read_text() == "mine: 1\n"


def test_nothing_but_the_roots_changes(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(real.VARIABLE, str(project.parent))
    real.run_real(project)
    ours = read_params(REPOSITORY / "profiles" / "real.yaml").model_dump()
    theirs = read_params(project / "seen.yaml").model_dump()
    assert ours.pop("acquire") != theirs.pop("acquire")
    assert ours == theirs


@pytest.mark.parametrize("name", ["two\nlines", "tab\there", "no text \udcff"])
def test_refuses_a_folder_that_yaml_cannot_hold(
    project: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    folder = project.parent / name
    folder.mkdir()
    monkeypatch.setenv(real.VARIABLE, str(folder))
    with pytest.raises(ValueError, match="PCRDIFF_REAL_DATA needs the path in printable"):
        real.run_real(project)
    assert (project / "params.yaml").read_text() == "mine: 1\n"
