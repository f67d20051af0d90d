"""DVC stage ``acquire``: a raw data set in its official layout, made up, named or downloaded."""

import argparse
from pathlib import Path

from pipeline.acquiring import acquire
from pipeline.params import pick, read_params
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, acquire the data set, write its manifest."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dataset", required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    section = pick(params.acquire, args.dataset, "acquire")
    with journal(params={"dataset": args.dataset, "source": section.source}):
        acquire(section, args.out, seed=params.seed)


if __name__ == "__main__":
    run(main)
