"""Wherever work is done, the results are the same bytes."""

import os
import pickle
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from pcrdiff.geometry.precision import SearchPrecision, search_precision, set_search_precision
from pcrdiff.loops import in_turn
from pipeline.compute import workers as spreading
from pipeline.compute.workers import AHEAD, _call_there, spread_over
from pipeline.settings.params import Compute
from tests.described import REPOSITORY
from tests.pipeline.compute.dask_on_loopback import dask_cluster
from tests.tiny import (
    CF,
    PAIRS,
    SCENARIO,
    instance,
    refusal,
    run_instance,
    tiny_params,
    write_params,
)

TWO = Compute(workers=2, scheduler=None)


def negate(item: int) -> tuple[int, int]:
    return -item, os.getpid()


def settled(item: int) -> tuple[int, bool, bool]:
    del item
    tiny = torch.tensor([1e-39]) * 0.5
    return torch.get_num_threads(), tiny.item() == 0, torch.are_deterministic_algorithms_enabled()


def num_threads(item: int) -> int:
    del item
    return torch.get_num_threads()


def searching(item: int) -> str:
    del item
    return search_precision()


def refuse(item: int) -> int:
    if item == 3:
        raise ValueError("item 3 needs to be another")
    return item


def die(item: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return item


def multiply(factor: np.ndarray, item: np.ndarray) -> np.ndarray:
    product: np.ndarray = factor * item
    return product


@pytest.fixture
def unsettled() -> Iterator[None]:
    """This process is afterwards as it was."""
    yield
    torch.set_num_threads(1)
    torch.set_flush_denormal(False)
    torch.use_deterministic_algorithms(False)


# Several processes.


def test_one_worker_is_this_process() -> None:
    assert spread_over(Compute(workers=1, scheduler=None), threads=1) is in_turn


@pytest.mark.parametrize(("workers", "threads"), [(2, 2), (3, 2), (1, 4)])
def test_workers_of_several_threads_are_fewer(workers: int, threads: int) -> None:
    assert spread_over(Compute(workers=workers, scheduler=None), threads) is in_turn


@pytest.mark.parametrize(("workers", "threads"), [(2, 1), (4, 2)])
def test_results_come_in_order_from_other_processes(workers: int, threads: int) -> None:
    spread = spread_over(Compute(workers=workers, scheduler=None), threads)
    results, processes = zip(*spread(negate, range(40)), strict=True)
    assert results == tuple(range(0, -40, -1))
    assert os.getpid() not in processes
    assert 1 <= len(set(processes)) <= 2


def test_a_function_with_arrays_and_items_that_are_arrays() -> None:
    function = partial(multiply, np.arange(3.0))
    items = [np.full(3, k) for k in range(5)]
    found = list(spread_over(TWO, threads=1)(function, items))
    np.testing.assert_array_equal(found, [k * np.arange(3.0) for k in range(5)])


@pytest.mark.parametrize("threads", [1, 2])
def test_a_worker_is_settled_like_its_parent(threads: int) -> None:
    spread = spread_over(Compute(workers=2 * threads, scheduler=None), threads)
    flushes = torch.set_flush_denormal(True)
    torch.set_flush_denormal(False)
    assert set(spread(settled, range(4))) == {(threads, flushes, True)}


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
@pytest.mark.parametrize("threads", [1, 2])
def test_a_worker_searches_in_its_parents_precision(
    precision: SearchPrecision, threads: int
) -> None:
    """Both a fork and a process that is started anew."""
    set_search_precision(precision)
    spread = spread_over(Compute(workers=2 * threads, scheduler=None), threads)
    assert set(spread(searching, range(4))) == {precision}


@pytest.mark.usefixtures("unsettled")
def test_a_dask_worker_is_settled_anew_by_each_that_sends_it_work() -> None:
    """It outlives a stage, and works for several in turn."""
    threads, precision = pickle.dumps(num_threads), pickle.dumps(searching)
    for asked in (1, 2, 1):
        assert _call_there(threads, asked, "float32", 0) == asked
    wanted: list[SearchPrecision] = ["bfloat16", "float32", "bfloat16"]
    for one in wanted:
        assert _call_there(precision, 1, one, 0) == one


def test_only_a_few_items_are_under_way() -> None:
    asked: list[int] = []

    def items() -> Iterator[int]:
        for k in range(100):
            asked.append(k)
            yield k

    results = spread_over(TWO, threads=1)(negate, items())
    assert asked == []
    for k in range(3):
        next(results)
        assert len(asked) == 2 * AHEAD + k
    results.close()  # type: ignore[attr-defined]  # a generator
    assert len(asked) == 2 * AHEAD + 2


def test_what_a_worker_raises_is_raised_here_in_its_place() -> None:
    results = spread_over(TWO, threads=1)(refuse, range(10))
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(ValueError, match=r"^item 3 needs to be another$"):
        next(results)


def test_a_worker_that_dies_is_an_error_and_no_wait() -> None:
    with pytest.raises(RuntimeError, match=r"one of 2 workers was killed, as .* memory"):
        list(spread_over(TWO, threads=1)(die, range(3)))


def test_more_workers_than_the_system_allows_is_one_sentence_and_none_is_waited_for() -> None:
    script = """
import resource
from pipeline.settings.params import Compute
from pipeline.compute.workers import spread_over
from pipeline.compute.stage import run
from tests.pipeline.compute.test_workers import negate

def main():
    resource.setrlimit(resource.RLIMIT_NOFILE, (60, 60))
    list(spread_over(Compute(workers=200, scheduler=None), threads=1)(negate, range(9)))

run(main, "test")
"""
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 1
    assert "compute.workers asks for 200 processes: [Errno " in done.stderr
    assert "Traceback" not in done.stderr


def test_workers_do_not_outlive_a_parent_that_is_killed() -> None:
    code = (
        "import os, signal, sys\n"
        "from tests.pipeline.compute.test_workers import *\n"
        "for _, process in spread_over(TWO, threads=1)(negate, range(100000)):\n"
        "    print(process, flush=True)\n"
    )
    command = [sys.executable, "-c", code]
    parent = subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE)
    assert parent.stdout is not None
    workers = {int(parent.stdout.readline()) for _ in range(50)}
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 20
    while any(map(is_alive, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_alive, workers))


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


# A scheduler.


@pytest.mark.parametrize("scheduler", ["here:8786", "tcp://here", "http://here:1", "tcp://a b:1"])
def test_refuses_what_is_no_address(scheduler: str) -> None:
    with pytest.raises(ValueError, match="scheduler"):
        Compute(workers=1, scheduler=scheduler)


def tell(compute: dict[str, object]) -> None:
    params = tiny_params() | {"compute": compute}
    params["run"]["classical"] = ["icp", "constant", "kiss_matcher"]
    write_params(params)


def test_a_scheduler_that_is_not_there_is_one_sentence_within_seconds(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spreading, "PATIENCE_S", 1)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    tell({"workers": 1, "scheduler": f"tcp://127.0.0.1:{port}"})
    (project / PAIRS).unlink()
    start = time.monotonic()
    said = refusal("preprocess", instance(f"preprocess@{SCENARIO}").argv)
    assert f"none answers at tcp://127.0.0.1:{port} within" in said
    assert time.monotonic() - start < 60
    assert not list((project / PAIRS).parent.iterdir())


STAGES = (
    f"preprocess@{SCENARIO}",
    f"evaluate@{CF}",
    "evaluate_classical@icp",
    "ablate_steps",
    "ablate",
)


def outputs(names: tuple[str, ...]) -> dict[str, bytes]:
    """What the stages write, made anew."""
    written: dict[str, bytes] = {}
    for name in names:
        outs = [Path(out) for out in instance(name).outs]
        for out in outs:
            shutil.rmtree(out) if out.is_dir() else out.unlink(missing_ok=True)
        run_instance(instance(name))
        files = [file for out in outs for file in ([out] if out.is_file() else out.rglob("*.*"))]
        written |= {str(file): file.read_bytes() for file in files}
    return written


@pytest.mark.usefixtures("project")
def test_stages_write_the_same_bytes_with_one_worker_and_with_two() -> None:
    tell({"workers": 1, "scheduler": None})
    alone = outputs(STAGES)
    tell({"workers": 2, "scheduler": None})
    assert outputs(STAGES) == alone


@pytest.mark.slow
def test_stages_write_the_same_bytes_by_dask_on_two_workers(project: Path) -> None:
    tell({"workers": 1, "scheduler": None})
    alone = outputs(STAGES)
    with dask_cluster(project, workers=2) as scheduler:
        tell({"workers": 1, "scheduler": scheduler})
        assert outputs(STAGES) == alone
        spread = spread_over(Compute(workers=1, scheduler=scheduler), threads=1)
        results, processes = zip(*spread(negate, range(40)), strict=True)
        assert results == tuple(range(0, -40, -1))
        assert len(set(processes)) == 2
        assert os.getpid() not in processes
        assert {one[0] for one in spread(settled, range(8))} == {1}
        set_search_precision("bfloat16")
        assert set(spread(searching, range(8))) == {"bfloat16"}
        with pytest.raises(ValueError, match=r"^item 3 needs to be another$"):
            list(spread(refuse, range(10)))


@pytest.mark.slow
def test_a_scheduler_without_workers_is_one_sentence(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spreading, "PATIENCE_S", 2)
    with dask_cluster(project, workers=0) as scheduler:
        spread = spread_over(Compute(workers=1, scheduler=scheduler), threads=1)
        with pytest.raises(ConnectionError, match=f"needs a `dask worker {scheduler}`"):
            next(spread(negate, range(3)))
