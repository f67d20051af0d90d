"""DVC stage ``ablate``: one thing varied, everything else as it is."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.ablating import ABLATIONS, Given
from pipeline.artifacts import write_ablation
from pipeline.evaluating import summarise
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register under each value, write a row for each pair."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--name", choices=sorted(ABLATIONS), required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    told = params.ablation.model_dump() | {"search_precision": search_precision()}
    with journal(params=told, inputs=[args.pairs]) as notes:
        test, answers = ABLATIONS[args.name](Given(params, args.pairs, args.models))
        write_ablation(args.answers, test, answers)
        for method, settings in answers.items():
            found = summarise(test, settings).items()
            notes.metrics({f"{method}.{name}": value for name, value in found})
        notes.artifact(args.answers)


if __name__ == "__main__":
    run(main)
