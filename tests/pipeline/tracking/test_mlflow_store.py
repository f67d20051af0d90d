"""MLFLOW_TRACKING_URI: paths in it start at the project, everything else is MLflow's own."""

import os
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from pipeline.tracking import mlflow_store
from pipeline.tracking.mlflow_store import (
    artifacts_folder,
    check_database,
    database_file,
    is_server,
    public,
    tracking_uri,
)


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("", "sqlite:///{root}/mlflow.db"),
        (" ", "sqlite:///{root}/mlflow.db"),
        ("sqlite:///deep/runs.db", "sqlite:///{root}/deep/runs.db"),
        ("sqlite:////shared/runs.db", "sqlite:////shared/runs.db"),
        ("sqlite:///runs.db?timeout=30", "sqlite:///{root}/runs.db?timeout=30"),
        ("sqlite:///./:memory:", "sqlite+pysqlite:///{root}/%3Amemory%3A"),
        ("mlruns", "file://{root}/mlruns"),
        ("my runs%20", "file://{root}/my%20runs%2520"),
        ("/shared/a:b", "file:///shared/a%3Ab"),
        ("file:my%20runs", "file://{root}/my%20runs"),
        ("file:", "file://{root}"),
        ("file:///shared/my%20runs", "file:///shared/my%20runs"),
    ],
)
def test_relative_stores_lie_in_the_project(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, given: str, meant: str
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", given)
    monkeypatch.chdir("/")
    assert tracking_uri(tmp_path) == meant.format(root=tmp_path)


@pytest.mark.parametrize(
    "uri",
    [
        "databricks",
        "databricks://profile",
        "databricks-uc",
        "databricks-uc://profile",
        "uc",
        "uc:http://localhost:8080",
        "http://127.0.0.1:5000",
        "https://me:secret@mlflow.example/runs",
        "postgresql://me:secret@host/runs",
        "postgresql+psycopg2://host/runs",
        "mysql+pymysql://host:3306/runs",
        "mssql+pyodbc://host/runs?driver=ODBC",
        "arn:aws:sagemaker:eu-west-1:1:mlflow-tracking-server/mine",
        "azureml://region.api.azureml.ms/mlflow/v1.0",
    ],
)
def test_what_mlflow_and_its_plugins_know_by_name_reaches_them_as_it_was_given(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, uri: str
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    assert tracking_uri(tmp_path) == uri
    assert database_file(uri) is None


@pytest.mark.parametrize(
    "uri", ["localhost:5000", "mlflow.example:80/runs", "[::1]:5000", "10.0.0.1:5000"]
)
def test_a_server_without_its_scheme_is_told_how_to_write_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, uri: str
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"{uri}\n")
    with pytest.raises(ValueError, match=f"names a server: write http://{re.escape(uri)}$"):
        tracking_uri(tmp_path)


def test_artifacts_lie_where_they_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir("/")
    mine = (tmp_path / "mlruns").as_uri()
    assert artifacts_folder("postgresql+psycopg2://host/runs", tmp_path) == mine
    assert artifacts_folder("mysql://host/runs", tmp_path) == mine
    assert (
        artifacts_folder("sqlite:////shared/100%25/x.db", tmp_path)
        == "file:///shared/100%25/mlruns"
    )
    for uri in ("databricks", "https://mlflow.example", "file:///shared/runs"):
        assert artifacts_folder(uri, tmp_path) is None


def test_a_server_is_told_from_a_store_that_one_could_serve() -> None:
    assert all(is_server(uri) for uri in ("databricks", "uc", "https://x", "databricks://me"))
    assert not any(is_server(uri) for uri in ("sqlite:////x", "file:///x", "postgresql://x/y"))


def test_passwords_are_hidden_and_paths_are_not() -> None:
    assert public("https://me:secret@mlflow.example") == "https://mlflow.example"
    assert public("sqlite:////me@home/mlflow.db") == "sqlite:////me@home/mlflow.db"


def write_database(path: Path, revision: str) -> None:
    """Write a database that says of itself that it is MLflow's, in this schema."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE alembic_version (version_num TEXT)")
        database.execute("INSERT INTO alembic_version VALUES (?)", (revision,))
        database.execute("CREATE TABLE filling AS SELECT zeroblob(100000)")
        database.commit()


def test_a_new_an_empty_and_a_known_database_are_taken(tmp_path: Path) -> None:
    check_database(tmp_path / "not" / "yet" / "there.db")
    (tmp_path / "empty.db").touch()
    check_database(tmp_path / "empty.db")
    write_database(tmp_path / "known.db", "451aebb31d03")  # among the first of MLflow's
    check_database(tmp_path / "known.db")
    (tmp_path / "link.db").symlink_to("known.db")
    check_database(tmp_path / "link.db")


def test_a_path_that_can_be_no_database_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("not a database, but long enough to be taken for one" * 99)
    (tmp_path / "link").symlink_to("nowhere/at/all")
    os.mkfifo(tmp_path / "pipe")
    for name, words in {
        ".": "is a folder",
        "pipe": "is not a file",
        "file/below/mlflow.db": "lies below .*file, which is not a folder",
        "link": "is a link to a file that is not there",
        "file": "cannot be used: file is not a database",
    }.items():
        with pytest.raises(ValueError, match=words):
            check_database(tmp_path / name)


def test_a_database_cut_short_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mlflow.db"
    write_database(path, "451aebb31d03")
    os.truncate(path, path.stat().st_size // 2 // 4096 * 4096)
    with pytest.raises(ValueError, match=r"is damaged|cannot be used: database disk image"):
        check_database(path)


def test_a_database_that_another_process_keeps_locked_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mlflow_store, "PATIENCE_SECONDS", 0.1)
    path = tmp_path / "mlflow.db"
    write_database(path, "451aebb31d03")
    with closing(sqlite3.connect(path, isolation_level=None)) as holder:
        holder.execute("BEGIN EXCLUSIVE")
        with pytest.raises(ValueError, match="cannot be used: database is locked"):
            check_database(path)
    check_database(path)


def test_a_database_of_a_newer_mlflow_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mlflow.db"
    write_database(path, "fedcba987654")
    with pytest.raises(ValueError, match=r"has schema fedcba987654, which .* does not know"):
        check_database(path)


@pytest.mark.parametrize("place", ["mlflow.db", "."])
def test_a_database_that_may_not_be_written_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    path = tmp_path / "mlflow.db"
    write_database(path, "451aebb31d03")
    shut = tmp_path / place
    monkeypatch.setattr(os, "access", lambda asked, _mode: Path(asked) != shut)
    with pytest.raises(PermissionError, match=f"needs {shut} to be writable"):
        check_database(path)
