"""What editors and file browsers leave beside code and data is not seen by DVC."""

import subprocess
from pathlib import Path

import pytest
from dvc.fs import localfs
from dvc.ignore import DvcIgnoreFilter
from dvc.repo import Repo

from pipeline.compute.checkpoints import fingerprint
from pipeline.tracking.dvcignore import seen_files
from pipeline.tracking.journal import content_md5
from tests.described import REPOSITORY, expand, read_repository_params

CODE = ("pcrdiff/clouds", "pcrdiff/models", "pipeline/reporting/templates", "stages", "benchmarks")
ANYWHERE = (
    ".#x.py",  # Emacs: a link that leads nowhere
    "#x.py#",
    "x.py~",
    ".x.py.swp",
    ".x.py.swo",
    ".DS_Store",
    "._x.py",
    ".ipynb_checkpoints/x.py",
    ".idea/x.py",
    "__pycache__/x.pyc",
    ".nfs0001",
    "Thumbs.db",
)
BESIDE_CODE = ("4913", "x.py.orig", "x.py.bak", "x.py___jb_tmp___", "notes.txt", ".hidden/x.py")


@pytest.fixture(scope="module")
def ignored() -> DvcIgnoreFilter:
    return DvcIgnoreFilter(localfs, str(REPOSITORY))


def is_ignored(ignored: DvcIgnoreFilter, path: str) -> bool:
    return bool(ignored.check_ignore(str(REPOSITORY / path)).match)


@pytest.mark.parametrize("name", ANYWHERE)
@pytest.mark.parametrize(
    "folder", [*CODE, "data/raw/toy", "data/raw/toy/deep", "models", "results"]
)
def test_dvc_does_not_see_what_editors_leave(
    ignored: DvcIgnoreFilter, folder: str, name: str
) -> None:
    assert is_ignored(ignored, f"{folder}/{name}")


@pytest.mark.parametrize("name", BESIDE_CODE)
@pytest.mark.parametrize("folder", CODE)
def test_in_folders_of_code_only_code_counts(
    ignored: DvcIgnoreFilter, folder: str, name: str
) -> None:
    assert is_ignored(ignored, f"{folder}/{name}")


def test_what_a_stage_depends_on_or_writes_is_seen(ignored: DvcIgnoreFilter) -> None:
    for instance in expand(read_repository_params()):
        paths = [*instance.deps, *instance.outs]
        assert [path for path in paths if is_ignored(ignored, path)] == []


def test_all_code_and_every_table_of_benchmarks_is_seen(ignored: DvcIgnoreFilter) -> None:
    listed = ["git", "ls-files", "pcrdiff", "pipeline", "stages", "benchmarks/*.csv"]
    done = subprocess.run(listed, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    names = [name for name in done.stdout.split() if not name.endswith(".md")]  # cards of weights
    assert len(names) > 100
    assert [name for name in names if is_ignored(ignored, name)] == []
    assert not is_ignored(ignored, "pcrdiff/clouds/deeper/new.py")
    assert not is_ignored(ignored, "data/raw/toy/airplane/train/airplane_0001.off")


def test_a_link_of_emacs_in_a_dep_neither_stops_dvc_nor_changes_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".dvcignore").write_text((REPOSITORY / ".dvcignore").read_text())
    (tmp_path / "pcrdiff" / "clouds").mkdir(parents=True)
    (tmp_path / "pcrdiff" / "clouds" / "x.py").write_text("")
    (tmp_path / "dvc.yaml").write_text(
        "stages:\n  make:\n    cmd: date > made\n    deps: [pcrdiff/clouds]\n    outs: [made]\n"
    )
    with Repo.init(str(tmp_path), no_scm=True) as repo:
        repo.reproduce()
        assert repo.status() == {}
    (tmp_path / "pcrdiff" / "clouds" / ".#x.py").symlink_to("me@host.123")
    (tmp_path / "pcrdiff" / "clouds" / "x.py~").write_text("old")
    with Repo(str(tmp_path)) as repo:
        assert repo.status() == {}
        assert repo.reproduce() == []


@pytest.fixture
def littered(tmp_path: Path) -> Path:
    """A project with code and data, and beside each of them what editors leave."""
    (tmp_path / ".dvc").mkdir()
    (tmp_path / ".dvcignore").write_text((REPOSITORY / ".dvcignore").read_text())
    for folder in (*CODE, "data/raw/toy", "benchmarks/details", "pipeline/reporting/deeper"):
        for name in ("x.py", "t.csv", "a.j2", "a.off", *ANYWHERE, *BESIDE_CODE):
            path = tmp_path / folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("")
    return tmp_path


@pytest.mark.parametrize("top", ["pcrdiff", "pipeline", "stages", "benchmarks", "data", "data/raw"])
def test_journals_and_checkpoints_see_what_dvc_sees(littered: Path, top: str) -> None:
    seen = DvcIgnoreFilter(localfs, str(littered)).find(localfs, str(littered / top))
    assert sorted(map(str, seen_files(littered / top))) == sorted(seen)


@pytest.mark.parametrize("name", ["x.py~", ".#x.py", "4913", "x.py.bak", ".hidden/x.py"])
@pytest.mark.parametrize("folder", ["pcrdiff/clouds", "stages"])
def test_an_editors_file_changes_no_digest_and_no_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(".dvc").mkdir()
    Path(".dvcignore").write_text((REPOSITORY / ".dvcignore").read_text())
    code = Path(folder, "x.py")
    code.parent.mkdir(parents=True)
    code.write_text("")
    dep = Path(folder.partition("/")[0])
    before = content_md5(dep), fingerprint({}, [dep])
    Path(folder, name).parent.mkdir(exist_ok=True)
    Path(folder, name).write_text("old")
    assert (content_md5(dep), fingerprint({}, [dep])) == before
    code.write_text("new")
    assert content_md5(dep) != before[0]
    assert fingerprint({}, [dep]) != before[1]


def test_a_dvcignore_that_is_not_utf8_is_named(littered: Path) -> None:
    (littered / ".dvcignore").write_bytes(b"# Ma\xdfe\n")
    with pytest.raises(ValueError, match=r"\.dvcignore needs UTF-8, byte 4 is not"):
        content_md5(littered / "pcrdiff")
