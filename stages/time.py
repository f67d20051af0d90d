"""DVC stage ``time``: seconds and memory per pair of every method, batch 1, on a quiet machine."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.machine import settle
from pipeline.params import SHOWN, read_params
from pipeline.stage import run
from pipeline.timing import mean_seconds, time_all, write_costs
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, time the registrations, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--costs", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    told = {"threads": params.threads, "search_precision": search_precision()}
    with journal(params=told, inputs=[args.pairs]) as notes:
        for name, costs in time_all(params, args.pairs, args.models):
            write_costs(args.costs / f"{name}.csv", costs)
            if name in SHOWN:
                notes.metrics({f"{SHOWN[name]}.seconds": mean_seconds(costs)})
        notes.artifact(args.costs)


if __name__ == "__main__":
    run(main)
