"""Calls into native code that may end its process: made in a child that is kept between calls."""

import os
import subprocess
import sys
import weakref
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any


class Isolated:
    """Calls functions in a child process, one at a time.

    The child starts with the first call and computes in one thread. It imports the modules of
    the functions that it is given, but not the parent's main module, as a child of
    multiprocessing would. It ends with its parent, whatever ends that.
    """

    def __init__(self, name: str, seconds: float) -> None:
        """``name`` is used in error messages; a call may take ``seconds``."""
        self.name, self.seconds = name, seconds
        self._child: _Child | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles have no child: it belongs to this process."""
        return {**self.__dict__, "_child": None}

    def call(self, function: Callable[..., Any], *arguments: object) -> Any:  # noqa: ANN401
        """``function(*arguments)``, computed in the child; all of it must be picklable.

        Raises:
            RuntimeError: The call ended the child, or took too long and was ended with it. The
                next call has a new child.
            Exception: What the function raised.
        """
        child, self._child = self._child or _Child(), None
        try:
            child.pipe.send((function, arguments))
            if not child.pipe.poll(self.seconds):
                raise RuntimeError(f"{self.name} needs an answer in {self.seconds:g} s, got none")
            raised, answer = child.pipe.recv()
        except (EOFError, ConnectionError) as error:
            code = child.process.wait()
            how = f"signal {-code}" if code < 0 else f"exit status {code}"
            raise RuntimeError(f"{self.name}'s native code ended its process ({how})") from error
        except BaseException:  # it may yet answer, and the next call would read that
            child.end()
            raise
        self._child = child
        if raised:
            raise answer
        return answer


class _Child:
    """The process and this end of the pipe to it; ends the process when it is dropped."""

    def __init__(self) -> None:
        self.pipe, theirs = Pipe()
        environment = {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(theirs.fileno())],
                env={**os.environ, **environment},
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,  # native code prints there
            )
        self.end = weakref.finalize(self, _end, self.process, self.pipe)


def _end(process: "subprocess.Popen[bytes]", pipe: Connection) -> None:
    pipe.close()
    process.kill()
    process.wait()


def _serve(pipe: Connection) -> None:
    """Answer calls until the parent hangs up."""
    while True:
        try:
            function, arguments = pipe.recv()
        except (EOFError, ConnectionError):
            return
        try:
            answer = (False, function(*arguments))
        except Exception as error:  # noqa: BLE001  (raised again in the parent)
            answer = (True, error)
        pipe.send(answer)


def _one_thread() -> None:
    """Hold this process to one processor: TBB starts as many threads as there are."""
    if sys.platform == "linux":
        allowed = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {allowed[os.getpid() % len(allowed)]})


if __name__ == "__main__":
    _one_thread()
    _serve(Connection(int(sys.argv[1])))
