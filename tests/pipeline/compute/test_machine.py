"""What a computation asks of the machine is there afterwards."""

import ctypes
import sys
from collections.abc import Iterator

import pytest
import torch

from pcrdiff.geometry.precision import search_precision
from pipeline.compute.machine import settle


@pytest.fixture(autouse=True)
def unsettled() -> Iterator[None]:
    yield
    torch.set_num_threads(1)
    torch.set_flush_denormal(False)
    torch.use_deterministic_algorithms(False)


def test_fixes_the_thread_count() -> None:
    settle(2)
    assert torch.get_num_threads() == 2
    settle(1)
    assert torch.get_num_threads() == 1


def test_fixes_the_precision_of_searches(processor: str) -> None:
    settle(1, "bfloat16")
    assert search_precision() == "bfloat16"
    settle(1, "auto")
    assert search_precision() == ("bfloat16" if processor == "with bfloat16" else "float32")
    settle(1)
    assert search_precision() == "float32"


def test_denormals_become_zero() -> None:
    tiny = torch.tensor([1e-39])
    torch.set_flush_denormal(False)
    if (tiny * 0.5).item() == 0 or not torch.set_flush_denormal(True):
        pytest.skip("this processor cannot choose")
    torch.set_flush_denormal(False)
    settle(1)
    assert (tiny * 0.5).item() == 0


def test_asks_for_deterministic_algorithms() -> None:
    assert not torch.are_deterministic_algorithms_enabled()
    settle(1)
    assert torch.are_deterministic_algorithms_enabled()


def test_settles_where_there_is_no_glibc(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise OSError("no such library")

    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr(sys, "platform", "darwin")
    settle(1)
    assert torch.get_num_threads() == 1
