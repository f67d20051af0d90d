"""DVC stage ``evaluate_classical``: the answers of the methods that learn nothing on one scenario."""

import argparse
from pathlib import Path

from pipeline.artifacts import read_pairs, write_estimates
from pipeline.evaluating import answer_settings, headline, load_settings, mean_error_r_deg
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, register every test pair with each method, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads)
    with journal(params={"scenario": args.pairs.stem}, inputs=[args.pairs]) as notes:
        test = read_pairs(args.pairs, "test")
        for name in params.run.classical:
            answers = answer_settings(params, load_settings(params, name, args.pairs, None), test)
            write_estimates(args.answers / f"{name}.csv", test, answers)
            notes.metrics({name: mean_error_r_deg(test, headline(answers))})
        notes.artifact(args.answers)


if __name__ == "__main__":
    run(main)
