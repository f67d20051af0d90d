"""Progress bars for the library's long loops."""

import sys
from collections.abc import Iterable, Sequence
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")


def bar(items: Sequence[T], description: str) -> Iterable[T]:
    """Draw a bar on a terminal; in a log, a line every ten seconds."""
    interval = 0.2 if sys.stderr.isatty() else 10.0
    return tqdm(items, desc=description, mininterval=interval, maxinterval=interval)
