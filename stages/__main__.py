"""``python -m stages STAGE ARGUMENT...``: runs a stage, and ends it with one sentence if it fails.

The stage is imported under its own name, so that what it pickles is found by the workers of another
machine, too.
"""

import sys
from functools import partial
from importlib import import_module

from pipeline.compute.stage import run

if __name__ == "__main__":
    name, *arguments = sys.argv[1:]
    run(partial(import_module(f"stages.{name}").main, arguments), name)
