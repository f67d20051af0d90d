"""DVC stage ``time``: seconds and memory per pair of one method, batch 1, on a quiet machine."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.timing import summarise, time_method, write_costs
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, time the registrations, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--weights", type=Path, help="of a learned method")
    parser.add_argument("--costs", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    inputs = [args.pairs, args.weights] if args.weights else [args.pairs]
    told = {"threads": params.threads, "search_precision": search_precision()}
    with journal(params=told, inputs=inputs) as notes:
        costs = time_method(params, args.method, args.pairs, args.weights)
        write_costs(args.costs, costs)
        notes.metrics(summarise(costs))
        notes.artifact(args.costs)


if __name__ == "__main__":
    run(main)
