"""Weights that come with the code: a training's, made smaller, with a card that says what they are."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float64

from pipeline.formats.files import write_atomically
from pipeline.formats.weights import (
    SHIPPED,
    WEIGHTS,
    halved,
    read_facts,
    read_weights,
    shipped_weights,
    write_weights,
)
from pipeline.reporting.numbers import RESAMPLES, bootstrap_interval
from pipeline.settings.params import DIFFUSED, TrainingParams
from pipeline.settings.profiles import profile_names, read_profile


def ship(root: Path, method: str, scenario: str) -> list[Path]:
    """Put the weights of a finished training under ``pcrdiff/weights``, matrices in float16.

    Returns:
        The weights and their card, which still lacks the errors: evaluating is a stage of its own.

    Raises:
        FileNotFoundError, ValueError: The training is not there or not what it should be.
    """
    trained = root / "models" / method / scenario / WEIGHTS
    facts = read_facts(trained)
    shipped = root / shipped_weights(method, scenario)
    write_weights(shipped, halved(read_weights(trained, method)), facts)
    return [shipped, write_card(root, method, scenario)]


def write_card(root: Path, method: str, scenario: str) -> Path:
    """Write the card of shipped weights, with the errors that they were evaluated to have.

    Raises:
        FileNotFoundError, ValueError: The weights are not there or not what they should be.
    """
    weights = root / shipped_weights(method, scenario)
    answers = root / "results" / "shipped" / method / f"{scenario}.csv"
    card = weights.with_suffix(".md")
    facts = read_facts(weights)
    profile = _profile(root, method, scenario, facts)
    text = "\n".join(_card(method, scenario, facts, profile, answers))
    write_atomically(card, text.encode())
    return card


def _profile(root: Path, method: str, scenario: str, facts: Mapping[str, Any]) -> str | None:
    """The profile that holds such a training: as many epochs, the same start, the same source."""
    wanted = TrainingParams(epochs=facts["epochs"], start=facts.get("start"))
    for name in profile_names(root):
        params = read_profile(root, name)
        if params.trainings.get(method, {}).get(scenario) != wanted:
            continue
        if params.acquire[params.scenarios[scenario].dataset].source == facts["data"]["source"]:
            return name
    return None


def _card(
    method: str, scenario: str, facts: Mapping[str, Any], profile: str | None, answers: Path
) -> Iterator[str]:
    data, network = facts["data"], facts["network"]
    yield f"# {method}, {scenario}"
    yield ""
    yield f"- **Trained on** {facts['train_pairs']:,} pairs of `{data['dataset']}` ({data['source']}),"
    yield f"  {data['points']:,} points a cloud before any crop."
    yield f"- **Terms of the data**: {data['licence']}. The weights are shipped under the code's licence,"
    yield "  naming the data; the data itself is not part of the repository."
    yield f"- **Training**: {facts['epochs']:,} epochs, {facts['steps']:,} steps of"
    points = (
        f", {facts['step_points']} points of each cloud a step" if "step_points" in facts else ""
    )
    yield f"  {facts['batch_size']} pairs, new poses in every epoch{points}; weights of epoch"
    yield f"  {facts['best_epoch']}, at {facts['val_error_r_deg']:.2f} degrees on validation pairs."
    if "start" in facts:
        yield f"- **Started** from the network for `{facts['start']}` that came with the code, md5"
        yield f"  `{facts['start_md5']}`; its training comes on top of this one."
    yield f"- **Network**: {', '.join(f'{key} {value}' for key, value in network.items())};"
    yield f"  {facts['parameters']:,} parameters, matrices in float16."
    yield from _again(method, scenario, profile)
    yield f"- **Not for** clouds that are not in the unit sphere, poses outside the spread of `{scenario}`,"
    yield "  or shapes unlike those of the data: no weights here were tested on them."
    if answers.is_file():
        yield ""
        yield "Errors on the test pairs of the scenario, with 95 % bootstrap intervals over pairs:"
        yield ""
        yield "| setting | pairs | mean ERROR(R), deg | median | mean ERROR(t) | below 5 deg |"
        yield "|---|---:|---:|---:|---:|---:|"
        yield from _errors(answers)
    yield ""


def _again(method: str, scenario: str, profile: str | None) -> Iterator[str]:
    if profile is None:
        yield "- **Again**: no profile holds this training."
        return
    diffused = method in DIFFUSED
    stage = f"train@{scenario}-{method}" if diffused else f"train_baselines@{method}"
    yield f"- **Again**: `pcrdiff profile {profile}`, `dvc repro {stage}`,"
    yield f"  `pcrdiff ship {method} {scenario}`."


def _errors(answers: Path) -> Iterator[str]:
    rows = pd.read_csv(answers)
    for setting, pairs in rows.groupby("setting"):
        turns, shifts = pairs["error_r_deg"].to_numpy(), pairs["error_t"].to_numpy()
        name = str(setting).removeprefix(SHIPPED).strip() or "paper"
        yield (
            f"| {name.replace('_', ' ')} | {len(pairs)} | {_mean(turns)} | {np.median(turns):.3g} "
            f"| {_mean(shifts)} | {100 * np.mean(turns < 5):.1f} % |"
        )


def _mean(values: Float64[np.ndarray, " pairs"]) -> str:
    resamples = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = bootstrap_interval(values, lambda x: np.asarray(x.mean(axis=-1)), resamples)
    return f"{values.mean():.3g} [{low:.3g}, {high:.3g}]"
