"""DVC stage ``walk``: the pose at every step of a few walks back from noise."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.artifacts import WEIGHTS
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal
from pipeline.walking import follow_walks
from pipeline.walks import write_walks


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, walk back, write two rows a step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--walks", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    scenario = params.ablation.scenario
    told = params.ablation.walk.model_dump() | {"search_precision": search_precision()}
    with journal(params=told, inputs=[args.pairs]):
        for method in params.ablation.methods:
            weights = args.models / method / scenario / WEIGHTS
            walks = follow_walks(params, method, args.pairs, weights)
            write_walks(args.walks / scenario / f"{method}.csv", walks)


if __name__ == "__main__":
    run(main)
