"""DVC stage ``evaluate``: the test pairs of a scenario to one method's answers and errors."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.artifacts import write_estimates, write_json
from pipeline.evaluating import evaluate_method, summarise
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register every pair, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--weights", type=Path, help="of a learned method")
    parser.add_argument("--answers", type=Path, required=True)
    parser.add_argument("--metrics", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    inputs = [args.pairs, args.weights] if args.weights else [args.pairs]
    told = params.diffusion.model_dump() | {"search_precision": search_precision()}
    with journal(params=told, inputs=inputs) as notes:
        test, answers = evaluate_method(params, args.method, args.pairs, args.weights)
        metrics = summarise(test, answers)
        write_estimates(args.answers, test, answers)
        write_json(args.metrics, metrics)
        notes.metrics(metrics)
        notes.artifact(args.answers)


if __name__ == "__main__":
    run(main)
