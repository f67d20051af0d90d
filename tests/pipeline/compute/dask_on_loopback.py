"""A ``dask scheduler`` and ``dask worker`` processes on this machine, as the commands start them."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tests.described import REPOSITORY

SECONDS = 120


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[None]:
    """A ``dask`` command while the ``with`` lasts, with the project on its path."""
    command = [sys.executable, "-m", "dask", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "OMP_NUM_THREADS": "1"}
    with (folder / f"{arguments[0]}.log").open("ab") as log:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log)
    try:
        yield
    finally:
        process.terminate()
        process.wait(SECONDS)


@contextmanager
def dask_cluster(folder: Path, workers: int) -> Iterator[str]:
    """The address of a scheduler with so many workers."""
    from distributed import Client

    file = folder / "scheduler.json"
    with ExitStack() as stack:
        told = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        stack.enter_context(running(folder, "scheduler", *told, "--scheduler-file", str(file)))
        deadline = time.monotonic() + SECONDS
        while not file.is_file() and time.monotonic() < deadline:
            time.sleep(0.1)
        for _ in range(workers):
            told = ("--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
            stack.enter_context(running(folder, "worker", *told, "--scheduler-file", str(file)))
        address: str = json.loads(file.read_text())["address"]
        with Client(address, set_as_default=False) as client:  # type: ignore[no-untyped-call]
            if workers:
                client.wait_for_workers(workers, timeout=SECONDS)
        yield address
