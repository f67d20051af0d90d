"""DVC stages ``ablate`` and ``ablate_steps``: one thing varied, everything else as it is."""

import argparse
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.ablating import ABLATIONS, Given
from pipeline.artifacts import write_ablation
from pipeline.machine import settle
from pipeline.params import pick, read_params
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register under each value, write a row for each pair."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--answers", type=Path, nargs="+", required=True, help="<ablation>.csv")
    args = parser.parse_args(argv)

    params = read_params()
    wanted = {path: pick(ABLATIONS, path.stem, "ablation") for path in args.answers}
    settle(params.threads, params.search_precision)
    told = {"search_precision": search_precision(), "scenario": params.ablation.scenario}
    with journal(params=told, inputs=[args.pairs]) as notes:
        for path, ablate in wanted.items():
            test, answers = ablate(Given(params, args.pairs, args.models))
            write_ablation(path, test, answers)
            notes.artifact(path)


if __name__ == "__main__":
    run(main)
