"""DVC stages ``evaluate``, ``evaluate_{baselines,classical,shipped}``: a method's answers."""

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path

from pcrdiff.geometry.precision import search_precision
from pcrdiff.registration import Method
from pipeline.answering import answer_settings, headline, mean_error_r_deg
from pipeline.compute.machine import settle
from pipeline.formats.answers import write_estimates
from pipeline.formats.files import write_json
from pipeline.formats.pairs import read_pairs
from pipeline.formats.verdicts import VERDICTS, write_verdicts
from pipeline.formats.weights import WEIGHTS, read_facts, shipped_setting
from pipeline.judging import learn_verdicts
from pipeline.loading import load_settings, load_shipped
from pipeline.settings.params import SHOWN, Params, pick, read_params, shown_scenario
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register every test pair, write a row for each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True, help="folder of the pair files")
    parser.add_argument("--models", type=Path, help="folder of the method, if it is a learned one")
    parser.add_argument("--shipped", type=Path, help="folder of weights that came with the code")
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    shown = {"method": args.method}
    if args.models or args.shipped:
        settle(params.threads, params.search_precision)
        shown["search_precision"] = search_precision()
    else:
        settle(params.threads)
    if args.method in SHOWN:
        shown |= {key: str(value) for key, value in params.diffusion.model_dump().items()}
    inputs = [path for path in (args.pairs, args.models, args.shipped) if path]
    with journal(params=shown, inputs=inputs) as notes:
        errors = {
            scenario: answer_scenario(params, args, scenario, settings)
            for scenario, settings in all_settings(params, args)
        }
        if not errors:
            raise ValueError(f"{args.shipped} needs weights for one of {params.run.scenarios}")
        notes.metrics(shown_errors(args.method, errors))
        notes.artifact(args.answers)


def answer_scenario(
    params: Params, args: argparse.Namespace, scenario: str, settings: Mapping[str, Method]
) -> float:
    """Write the answers to one scenario's test pairs; return the headline's error in degrees."""
    pairs = args.pairs / f"{scenario}.h5"
    test = read_pairs(pairs, "test")
    answers = answer_settings(params, settings, test)
    verdicts = learn_verdicts(params, settings, pairs)
    error = mean_error_r_deg(test, headline(answers))
    if args.shipped:
        answers = {shipped_setting(name): given for name, given in answers.items()}
        verdicts = {shipped_setting(name): verdict for name, verdict in verdicts.items()}
    write_estimates(args.answers / f"{scenario}.csv", test, answers, verdicts)
    if verdicts:
        write_verdicts(args.answers / VERDICTS / f"{scenario}.json", verdicts)
    return error


def all_settings(
    params: Params, args: argparse.Namespace
) -> Iterator[tuple[str, Mapping[str, Method]]]:
    """The scenarios that a method answers, and the method for each in all its settings."""
    if args.shipped:
        for scenario in params.run.scenarios:
            weights = args.shipped / f"{scenario}.safetensors"
            if weights.is_file():
                write_json(args.answers / f"{scenario}.json", read_facts(weights))
                yield scenario, load_shipped(params, args.method, weights)
        return
    for scenario, weights in weights_by_scenario(params, args.method, args.models).items():
        pairs = args.pairs / f"{scenario}.h5"
        yield scenario, load_settings(params, args.method, pairs, weights)


def weights_by_scenario(
    params: Params, method: str, models: Path | None
) -> Mapping[str, Path | None]:
    """The scenarios that a method answers, and its weights for each; a classical one has none."""
    if models is None:
        return dict.fromkeys(params.run.scenarios)
    return {name: models / name / WEIGHTS for name in pick(params.trainings, method, "trainings")}


def shown_errors(method: str, errors: Mapping[str, float]) -> dict[str, float]:
    """What MLflow shows: of CF and CB the report's numbers, of others their mean over scenarios."""
    if method not in SHOWN:
        return {method: sum(errors.values()) / len(errors)}
    return {f"{SHOWN[method]}.{shown_scenario(name)}": error for name, error in errors.items()}
