"""Names of files and folders, which other files have to hold."""

import os
from pathlib import Path

import pytest

from pcrdiff.data.tree import entries, walk_files


@pytest.mark.parametrize("name", ["caf\xe9_0001.off", "Stra\xdfe"])
def test_a_name_in_latin1_is_refused_with_its_folder(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "chair" / "train"
    folder.mkdir(parents=True)
    (folder / "chair_0001.off").touch()
    (folder / os.fsdecode(name.encode("latin-1"))).touch()
    with pytest.raises(ValueError, match=r"chair/train needs names in UTF-8, it holds b'.*\\x"):
        entries(folder)
    with pytest.raises(ValueError, match=r"chair/train needs names in UTF-8.*Latin-1"):
        list(walk_files(tmp_path))


def test_a_name_in_utf8_is_listed(tmp_path: Path) -> None:
    (tmp_path / "caf\xe9_0001.off").touch()
    assert [path.name for path in entries(tmp_path)] == ["caf\xe9_0001.off"]
