"""DVC stages ``evaluate`` and ``evaluate_baselines``: a learned method's answers on all its scenarios."""

import argparse
from collections.abc import Mapping
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pipeline.artifacts import WEIGHTS, read_pairs, write_estimates
from pipeline.evaluating import answer_settings, headline, load_settings, mean_error_r_deg
from pipeline.machine import settle
from pipeline.params import SHOWN, pick, read_params, shown_scenario
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register every test pair, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True, help="folder of the pair files")
    parser.add_argument("--models", type=Path, required=True, help="folder of the method")
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    told = {"search_precision": search_precision(), "method": args.method}
    if args.method in SHOWN:
        told |= {key: str(value) for key, value in params.diffusion.model_dump().items()}
    with journal(params=told, inputs=[args.pairs, args.models]) as notes:
        errors = {}
        for scenario in pick(params.trainings, args.method, "trainings"):
            pairs, weights = args.pairs / f"{scenario}.h5", args.models / scenario / WEIGHTS
            settings = load_settings(params, args.method, pairs, weights)
            test = read_pairs(pairs, "test")
            answers = answer_settings(params, settings, test)
            write_estimates(args.answers / scenario / f"{args.method}.csv", test, answers)
            errors[scenario] = mean_error_r_deg(test, headline(answers))
        notes.metrics(shown_errors(args.method, errors))
        notes.artifact(args.answers)


def shown_errors(method: str, errors: Mapping[str, float]) -> dict[str, float]:
    """What MLflow shows: of CF and CB the report's numbers, of others their mean over scenarios."""
    if method not in SHOWN:
        return {method: sum(errors.values()) / len(errors)}
    return {f"{SHOWN[method]}.{shown_scenario(name)}": error for name, error in errors.items()}


if __name__ == "__main__":
    run(main)
