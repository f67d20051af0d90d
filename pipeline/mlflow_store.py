"""Where MLflow's store lies: reads ``MLFLOW_TRACKING_URI`` and refuses a store that does not last."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

if TYPE_CHECKING:
    from sqlalchemy import URL

KEYWORDS = ("databricks", "databricks-uc", "uc")
"""What MLflow takes for a store by its name alone; any other bare word is a folder."""
SERVERS = ("http", "https", *KEYWORDS)


def tracking_uri(root: Path) -> str:
    """Return ``MLFLOW_TRACKING_URI`` with its paths made absolute: they start at the project.

    What is neither a folder nor a SQLite file belongs to MLflow and its plugins, and stays as it
    is.

    Raises:
        ValueError: It names a SQLite database in memory, or a server without its scheme.
    """
    uri = wanted_store()
    scheme = _scheme(uri)
    if scheme.partition("+")[0] == "sqlite":
        return _sqlite_uri(root, uri)
    if scheme == "file":
        path = uri.partition(":")[2]
        return uri if path.startswith("/") else (root.resolve() / unquote(path)).as_uri()
    if scheme or uri in KEYWORDS:
        return uri
    if re.match(r"[^/]+:\d+(/|$)", uri):
        raise ValueError(f"MLFLOW_TRACKING_URI={uri} names a server: write http://{uri}")
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

    if _scheme(uri).partition("+")[0] != "sqlite":
        return None
    return Path(make_url(uri).database or "")


def artifacts_folder(uri: str) -> str | None:
    """Return where artifacts go: ``mlruns`` beside a SQLite file; a server decides by itself."""
    database = database_file(uri)
    return (database.parent / "mlruns").as_uri() if database else None


def public(uri: str) -> str:
    """Return a URI without user name and password."""
    return re.sub(r"(?<!/)//[^/@\s]*@", "//", uri)


def _scheme(uri: str) -> str:
    found = re.match(r"([A-Za-z][A-Za-z0-9+.-]*):", uri)
    return found[1].lower() if found else ""


def _sqlite_uri(root: Path, uri: str) -> str:
    """Return the URI of a SQLite file with its path made absolute.

    ``:memory:``, no name at all, and SQLite's own URIs (``file:...``), which can name memory in
    many ways, are refused: what is written there is gone when the process ends.
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
    return _rendered(url.set(database=(root.resolve() / name).as_posix()))


def _rendered(url: "URL") -> str:
    """Return a SQLAlchemy URL as text.

    MLflow makes the folder of whatever follows ``sqlite:///`` without unquoting it; naming the
    driver keeps it from leaving a folder with a quoted name beside the real one.
    """
    text = url.render_as_string(hide_password=False)
    if unquote(text) != text and url.drivername == "sqlite":
        return url.set(drivername="sqlite+pysqlite").render_as_string(hide_password=False)
    return text
