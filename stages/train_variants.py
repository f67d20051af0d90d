"""DVC stages ``train_diffusion``, ``train_representation``, ``train_fusion``: Tables 3 to 5."""

import argparse
from pathlib import Path

from pipeline.params import read_params
from pipeline.stage import run
from pipeline.training import Task, train_all
from pipeline.variants import TRAINED, folder_of, variants


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train each method of an ablation with one value of what it varies."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ablation", choices=sorted(TRAINED), required=True)
    parser.add_argument("--value", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    tasks = [
        Task(
            params.ablation.scenario,
            method,
            args.pairs,
            args.models.parent / folder_of(args.ablation, method, variant),
            variant,
        )
        for method, variant in variants(params.ablation, args.ablation, args.value)
    ]
    train_all(params, tasks)


if __name__ == "__main__":
    run(main)
