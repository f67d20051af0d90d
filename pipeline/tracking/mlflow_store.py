"""Where MLflow's store lies: reads ``MLFLOW_TRACKING_URI`` and refuses a store that does not last."""

import os
import re
import sqlite3
from contextlib import closing
from pathlib import Path
from urllib.parse import unquote

KEYWORDS = ("databricks", "databricks-uc", "uc")
"""What MLflow takes for a store by its name alone; any other bare word is a folder."""
DATABASES = ("mssql", "mysql", "postgresql", "sqlite")
SERVERS = ("http", "https", *KEYWORDS)
PATIENCE_SECONDS = 20.0  # how long another writer may keep a SQLite file, as MLflow has it


def tracking_uri(root: Path) -> str:
    """Return ``MLFLOW_TRACKING_URI`` with its paths made absolute: they start at the project.

    What is neither a folder nor a SQLite file belongs to MLflow and its plugins, and stays as it
    is.

    Raises:
        ValueError: It names a SQLite database in memory, or a server without its scheme.
    """
    uri = wanted_store()
    scheme = _scheme(uri)
    if _dialect(uri) == "sqlite":
        return _sqlite_uri(root, uri)
    if scheme == "file":
        path = uri.partition(":")[2]
        return uri if path.startswith("/") else (root.resolve() / unquote(path)).as_uri()
    if re.match(r"[^/]+:\d+(/|$)", uri):
        raise ValueError(f"MLFLOW_TRACKING_URI={uri} names a server: write http://{uri}")
    if scheme or uri in KEYWORDS:
        return uri
    return (root.resolve() / uri).as_uri()


def wanted_store() -> str:
    """Return ``MLFLOW_TRACKING_URI`` as it was given, or what stands for it."""
    return os.environ.get("MLFLOW_TRACKING_URI", "").strip() or "sqlite:///mlflow.db"


def is_server(uri: str) -> bool:
    """Tell whether something else serves this store already."""
    return uri in KEYWORDS or _scheme(uri) in SERVERS


def database_file(uri: str) -> Path | None:
    """Return the file of a SQLite store, as :func:`tracking_uri` names it; None for the others."""
    from sqlalchemy import make_url

    if _dialect(uri) != "sqlite":
        return None
    return Path(make_url(uri).database or "")


def artifacts_folder(uri: str, root: Path) -> str | None:
    """Return where artifacts go; a server and a folder of runs decide on their own.

    Beside a database it is ``mlruns``: next to a SQLite file, in the project for the others,
    which would take the current folder, and that of ``dvc exp run --temp`` is soon gone.
    """
    database = database_file(uri)
    if not database and _dialect(uri) not in DATABASES:
        return None
    return ((database.parent if database else root.resolve()) / "mlruns").as_uri()


def check_database(path: Path) -> None:
    """Refuse a SQLite file that MLflow cannot write, before it tries that for minutes.

    Raises:
        OSError: The file or its folder may not be written, or cannot be looked at.
        ValueError: It is no file, lies below one, is damaged, locked, or of a newer MLflow.
    """
    if path.is_symlink() and not path.exists():
        raise ValueError(f"MLflow's database {path} is a link to a file that is not there")
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "not a file"
        raise ValueError(f"MLflow's database {path} is {kind}; needed is a file")
    above = next(folder for folder in path.parents if folder.exists())
    if not above.is_dir():
        raise ValueError(f"MLflow's database {path} lies below {above}, which is not a folder")
    for place in (above, path):
        if place.exists() and not os.access(place, os.W_OK):
            raise PermissionError(f"MLflow's database {path} needs {place} to be writable")
    if path.exists() and (revision := _revision(path)):
        _check_schema(path, revision)


def _revision(path: Path) -> str | None:
    """Return which of MLflow's schemas a sound database has; None before there is one."""
    try:
        with closing(sqlite3.connect(path, PATIENCE_SECONDS, isolation_level=None)) as database:
            database.execute("BEGIN IMMEDIATE")
            database.execute("ROLLBACK")
            (found,) = database.execute("PRAGMA quick_check(1)").fetchone()
            if found != "ok":
                raise ValueError(f"MLflow's database {path} is damaged: {' '.join(found.split())}")
            tables = "SELECT 1 FROM sqlite_master WHERE name = 'alembic_version'"
            if not database.execute(tables).fetchone():
                return None
            row = database.execute("SELECT version_num FROM alembic_version").fetchone()
    except sqlite3.Error as error:
        raise ValueError(f"MLflow's database {path} cannot be used: {error}") from error
    return str(row[0]) if row else None


def _check_schema(path: Path, revision: str) -> None:
    """Refuse a schema that is not among those the installed MLflow knows."""
    import mlflow
    from alembic.script import ScriptDirectory
    from alembic.util import CommandError

    scripts = ScriptDirectory(str(Path(mlflow.__file__).parent / "store" / "db_migrations"))
    try:
        scripts.get_revision(revision)
    except CommandError as error:
        here = f"the installed MLflow {mlflow.__version__} does not know"
        raise ValueError(
            f"MLflow's database {path} has schema {revision}, which {here}: a newer one wrote it"
        ) from error


def public(uri: str) -> str:
    """Return a URI without user name and password."""
    return re.sub(r"(?<!/)//[^/@\s]*@", "//", uri)


def _scheme(uri: str) -> str:
    found = re.match(r"([A-Za-z][A-Za-z0-9+.-]*):", uri)
    return found[1].lower() if found else ""


def _dialect(uri: str) -> str:
    return _scheme(uri).partition("+")[0]  # without the driver


def _sqlite_uri(root: Path, uri: str) -> str:
    """Return the URI of a SQLite file with its path made absolute.

    ``:memory:``, no name at all, and SQLite's own URIs (``file:...``), which can name memory in
    many ways, are refused: what is written there is gone when the process ends.

    MLflow makes the folder of whatever follows ``sqlite:///`` without unquoting it; naming the
    driver keeps it from leaving a folder with a quoted name beside the real one.
    """
    from sqlalchemy import make_url
    from sqlalchemy.exc import ArgumentError

    need = "needed is a file that lasts, as in sqlite:///mlflow.db"
    try:
        url = make_url(uri)
    except ArgumentError as error:
        raise ValueError(f"MLFLOW_TRACKING_URI={uri} is no SQLite URI; {need}") from error
    name = url.database or ":memory:"
    if name == ":memory:" or name.startswith("file:") or "uri" in url.query:
        raise ValueError(f"MLFLOW_TRACKING_URI={uri} may be a database in memory; {need}")
    url = url.set(database=(root.resolve() / name).as_posix())
    text = url.render_as_string(hide_password=False)
    if unquote(text) != text and url.drivername == "sqlite":
        return url.set(drivername="sqlite+pysqlite").render_as_string(hide_password=False)
    return text
