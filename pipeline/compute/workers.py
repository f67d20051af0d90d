"""Where independent work is done: in this process, in several of this machine, on other machines."""

import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import lru_cache, partial
from multiprocessing import active_children, get_context
from threading import get_ident
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from pcrdiff.geometry.precision import SearchPrecision, search_precision
from pcrdiff.loops import Item, Result, Spread, in_turn
from pipeline.compute.machine import end_with_parent, settle
from pipeline.settings.params import Compute

if TYPE_CHECKING:
    from distributed import Client

Output = TypeVar("Output", covariant=True)
# What is unpickled below are bytes that this process made of its own objects, never a file. Each
# worker so has a copy without what belongs to this process alone (`pcrdiff.bindings.isolation`).

AHEAD = 4
"""Items that are on their way to a worker, in one, or back: with them memory stays bounded."""
PATIENCE_S = 10
"""Timeout in seconds for a scheduler, and for its first worker."""


class _Future(Protocol[Output]):
    def result(self) -> Output: ...


def spread_over(compute: Compute, threads: int) -> Spread:
    """How work is spread: over a scheduler's workers, ``compute.workers`` processes, or not at all.

    A worker computes in ``threads`` threads and in the precision that is set here, as this process
    would: where threads are several, there are fewer workers.
    """
    if compute.scheduler is not None:
        return partial(_over_machines, compute.scheduler, threads)
    processes = compute.workers // threads
    return in_turn if processes <= 1 else partial(_over_processes, processes, threads)


def _in_order(
    submit: Callable[[Item], _Future[Result]], items: Iterable[Item], ahead: int
) -> Iterator[Result]:
    """The results in the order of the items, of which at most ``ahead`` are under way."""
    waiting: deque[_Future[Result]] = deque()
    for item in items:
        waiting.append(submit(item))
        if len(waiting) == ahead:
            yield waiting.popleft().result()
    while waiting:
        yield waiting.popleft().result()


def _over_processes(
    processes: int, threads: int, function: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[Result]:
    """One-threaded workers are forks, there at once; OpenMP's threads would not survive that."""
    context = get_context("fork" if threads == 1 else "spawn")
    given = (pickle.dumps(function), threads, search_precision())
    pool = ProcessPoolExecutor(processes, context, _start_worker, given)
    try:
        _begin(pool, processes)
        yield from _in_order(lambda item: pool.submit(_call_here, item), items, AHEAD * processes)
    except BrokenProcessPool as error:
        raise RuntimeError(
            f"one of {processes} workers was killed, as the system does where memory runs out; "
            "with a smaller compute.workers less is needed"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(pool: ProcessPoolExecutor, processes: int) -> None:
    """Start the workers; where the system refuses some, none is left to be waited for."""
    others = active_children()
    try:
        pool.submit(int)
    except OSError as error:
        for child in set(active_children()) - set(others):
            child.kill()
        raise OSError(f"compute.workers asks for {processes} processes: {error}") from error


_here: list[Callable[[Any], Any]] = []
"""In a worker of this machine, the function it is for."""


def _start_worker(pickled: bytes, threads: int, precision: SearchPrecision) -> None:
    end_with_parent()
    settle(threads, precision)
    _here[:] = [pickle.loads(pickled)]


def _call_here(item: Any) -> Any:  # noqa: ANN401  as the function
    return _here[0](item)


def _over_machines(
    scheduler: str, threads: int, function: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[Result]:
    from distributed import KilledWorker

    with _connected(scheduler) as client:
        (pickled,) = client.scatter([pickle.dumps(function)], broadcast=True)  # type: ignore[no-untyped-call]
        given = (pickled, threads, search_precision())
        submit = partial(client.submit, _call_there, *given, pure=False)
        try:
            ahead = AHEAD * sum(client.nthreads().values())  # type: ignore[no-untyped-call]
            yield from _in_order(submit, items, ahead)
        except KilledWorker as error:
            raise RuntimeError(f"the workers of {scheduler} died of a task: {error}") from error


@contextmanager
def _connected(scheduler: str) -> "Iterator[Client]":
    """A scheduler that answers and has a worker.

    Raises:
        ConnectionError: It does not, or has none.
    """
    from distributed import Client

    try:
        client = Client(  # type: ignore[no-untyped-call]
            scheduler, timeout=PATIENCE_S, set_as_default=False
        )
    except (OSError, ValueError) as error:
        raise ConnectionError(
            f"compute.scheduler needs a `dask scheduler`, none answers at {scheduler} "
            f"within {PATIENCE_S} s"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            raise ConnectionError(
                f"compute.scheduler {scheduler} needs a `dask worker {scheduler}`, "
                f"it has none for {PATIENCE_S} s"
            ) from error
        yield client


def _call_there(
    pickled: bytes,
    threads: int,
    precision: SearchPrecision,
    item: Any,  # noqa: ANN401  as the function
) -> Any:  # noqa: ANN401
    """Settled for each item: what the worker did in between may have asked for something else."""
    settle(threads, precision)
    return _prepared(pickled, get_ident())(item)


@lru_cache(maxsize=8)
def _prepared(pickled: bytes, thread: int) -> Callable[[Any], Any]:
    """The function, once for each of a worker's threads, which may change it as they call it."""
    del thread
    function: Callable[[Any], Any] = pickle.loads(pickled)
    return function
