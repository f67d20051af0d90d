"""How a stage ends: quietly, or with one sentence and exit code 1."""

import sys
from collections.abc import Callable

LONGEST = 2000
"""Characters of a sentence."""


def run(main: Callable[[], None], name: str) -> None:
    """Run the stage of this name; an error that a user can mend is one sentence without a traceback."""
    try:
        main()
    except (ValueError, OSError, RuntimeError, MemoryError, OverflowError) as error:
        sys.exit(f"{name}: {sentence(error)}")


def sentence(error: Exception) -> str:
    """Return what an error says, on one line; of those that name no cause, the cause too."""
    said = " ".join(str(error).split())
    causes = {
        MemoryError: "the memory is too small",
        OverflowError: "a number is too large",
        RecursionError: "something is nested too deeply",
    }
    cause = next((cause for kind, cause in causes.items() if isinstance(error, kind)), "")
    whole = ": ".join(part for part in (cause, said) if part)
    if len(whole) <= LONGEST:
        return whole
    return f"{whole[: LONGEST - 500]} ... {whole[-500:]}"  # where, and what was needed
