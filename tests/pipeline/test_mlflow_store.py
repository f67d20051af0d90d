"""MLFLOW_TRACKING_URI: paths in it start at the project, everything else is MLflow's own."""

from pathlib import Path

import pytest

from pipeline.mlflow_store import artifacts_folder, database_file, is_server, public, tracking_uri


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
    assert artifacts_folder(uri) is None


def test_a_server_is_told_from_a_store_that_one_could_serve() -> None:
    assert all(is_server(uri) for uri in ("databricks", "uc", "https://x", "databricks://me"))
    assert not any(is_server(uri) for uri in ("sqlite:////x", "file:///x", "postgresql://x/y"))


def test_passwords_are_hidden_and_paths_are_not() -> None:
    assert public("https://me:secret@mlflow.example") == "https://mlflow.example"
    assert public("sqlite:////me@home/mlflow.db") == "sqlite:////me@home/mlflow.db"
