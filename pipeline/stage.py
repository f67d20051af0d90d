"""How a stage ends: quietly, or with one sentence and exit code 1."""

import sys
from collections.abc import Callable
from pathlib import Path


def run(main: Callable[[], None]) -> None:
    """Run a stage's main; what a user can mend is said in one sentence, without a traceback."""
    try:
        main()
    except (ValueError, OSError, RuntimeError) as error:
        name = main.__module__ if main.__module__ != "__main__" else Path(sys.argv[0]).stem
        sys.exit(f"{name}: {' '.join(str(error).split())}")
