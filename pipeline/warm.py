"""A stage's command, run in a fork of a process that has already loaded PyTorch.

Loading it takes two seconds, and what its optimizers ask for two more: for two hundred short
stages more than for many a training. Only other people's packages are taken over; a stage reads
the project's own code from disk, as `python -m` would.
"""

import importlib
import os
import runpy
import shlex
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import dvc.stage.run
from dvc.stage.exceptions import StageCmdFailedError

PACKAGES = ("h5py", "jaxtyping", "pydantic", "safetensors.torch", "torch", "torch._dynamo")
"""What the stages load and take over; Open3D, which starts threads, is not among them."""
OWN = ("pcrdiff", "pipeline", "stages")
FORK = get_context("fork")


def preload() -> None:
    """Load what the stages take over."""
    for name in PACKAGES:
        importlib.import_module(name)


@contextmanager
def commands_in_forks() -> Iterator[None]:
    """Let DVC run those commands that are a stage of ours in a fork of this process."""
    from pipeline.machine import end_with_parent  # it loads PyTorch

    in_shell = dvc.stage.run._run

    def run(executable: str, command: str, **how: Any) -> None:  # noqa: ANN401  for Popen
        words = stage_words(command)
        if words is None or not is_own_python(Path(how["env"]["DVC_ROOT"])):
            in_shell(executable, command, **how, preexec_fn=end_with_parent)
            return
        process = FORK.Process(target=run_stage, args=(words, how["cwd"], how["env"]))
        process.start()
        process.join()
        if process.exitcode != 0:
            raise StageCmdFailedError(command, process.exitcode)

    dvc.stage.run._run = run
    try:
        yield
    finally:
        dvc.stage.run._run = in_shell


def stage_words(command: str) -> list[str] | None:
    """``[module, *arguments]`` of a command that is one `python -m stages.…`; None of any other."""
    try:
        words = shlex.split(command)
    except ValueError:
        return None  # a quote is missing, as the shell will say
    if words[:2] == ["env", "PATH=$DVC_ROOT/.venv/bin:$PATH"]:
        del words[:2]
    is_ours = words[:2] == ["python", "-m"] and "".join(words[2:3]).startswith("stages.")
    plain = not set(";&|<>`$") & set("".join(words))
    return words[2:] if is_ours and plain else None


def is_own_python(root: Path) -> bool:
    """Whether the python that a command of this project takes is the one that runs here."""
    there = root / ".venv"
    return not there.is_dir() or there.samefile(sys.prefix)


def run_stage(words: list[str], folder: str, environment: Mapping[str, str]) -> None:
    """Do in this process what `python -m` would do in a new one; exits as it would."""
    from pipeline.machine import end_with_parent

    end_with_parent()
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.path[0] = folder
    sys.argv[:] = words
    for name in [name for name in sys.modules if name.partition(".")[0] in OWN]:
        del sys.modules[name]
    importlib.invalidate_caches()
    runpy.run_module(words[0], run_name="__main__", alter_sys=True)
