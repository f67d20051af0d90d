"""DVC stage ``train_baselines``: one learned method, trained on each of its scenarios."""

import argparse
from pathlib import Path

from pipeline.params import pick, read_params
from pipeline.stage import run
from pipeline.training import Task, train_all


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train on one scenario after the other, write a folder for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True, help="folder of the pair files")
    parser.add_argument("--models", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    tasks = [
        Task(scenario, args.method, args.pairs / f"{scenario}.h5", args.models / scenario)
        for scenario in pick(params.trainings, args.method, "trainings")
    ]
    train_all(params, tasks)


if __name__ == "__main__":
    run(main)
