"""What a long computation asks of the machine it runs on."""

import ctypes
import os
import re
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pcrdiff.geometry.precision import Asked

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4  # glibc's mallopt
_PR_SET_PDEATHSIG = 1  # of Linux's prctl


def settle(threads: int, search_precision: "Asked" = "float32") -> None:
    """Fix the thread count and the precision of searches, flush denormals, keep freed memory.

    The first two are part of the result: sums are cut differently for another count, and a search
    in bfloat16 may take another point. Denormals
    (in Adam's moments and in softmax tails) cost a factor on every step that meets them. glibc
    hands large blocks back to the kernel after each step and asks for them again in the next.
    """
    import torch  # a process that only runs others does without

    from pcrdiff.geometry.precision import resolve, set_search_precision

    torch.set_num_threads(threads)
    set_search_precision(resolve(search_precision))
    torch.set_flush_denormal(True)
    torch.set_deterministic_debug_mode("error")
    # What is not yet written is never read here; filling it first cost a tenth of a step.
    torch.utils.deterministic.fill_uninitialized_memory = False  # type: ignore[attr-defined]
    if sys.platform == "linux" and os.confstr("CS_GNU_LIBC_VERSION"):
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_MMAP_MAX, 0)
        libc.mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        libc.mallopt(_M_TOP_PAD, 2**29)


def end_with_parent(number: int = signal.SIGKILL) -> None:
    """Let this process be sent a signal when the one that started it dies, however that dies."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, number)


def resident(which: str) -> float:
    """Resident memory of this process in MiB, now (``VmRSS``) or at its highest (``VmHWM``).

    Raises:
        FileNotFoundError: The system has no ``/proc``.
    """
    status = Path("/proc/self/status").read_text(encoding="utf-8", errors="replace")
    found = re.search(rf"^{which}:\s+(\d+) kB$", status, re.MULTILINE)
    if found is None:
        raise ValueError(f"/proc/self/status needs a line {which}, it has none")
    return int(found[1]) / 1024


def forget_peak() -> None:
    """Let the highest resident memory be counted from now on."""
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
