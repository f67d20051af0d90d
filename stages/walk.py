"""DVC stage ``walk``: the pose at every step of a few walks back from noise."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal
from pipeline.walking import follow_walks
from pipeline.walks import write_walks


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, walk back, write two rows a step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    for name in ("pairs", "weights", "walks"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    told = params.ablation.walk.model_dump() | {"search_precision": search_precision()}
    with journal(params=told, inputs=[args.pairs, args.weights]):
        write_walks(args.walks, follow_walks(params, args.method, args.pairs, args.weights))


if __name__ == "__main__":
    run(main)
