"""DVC stage ``train``: the pairs of a scenario to the weights of one method."""

import argparse
from pathlib import Path

from pipeline.params import read_params
from pipeline.stage import run
from pipeline.training import Task, train_all


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train, write the best weights, the curve and what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of its files")
    args = parser.parse_args(argv)

    train_all(read_params(), [Task(args.scenario, args.method, args.pairs, args.models)])


if __name__ == "__main__":
    run(main)
