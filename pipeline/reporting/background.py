"""Read what stands behind the numbers: how a method was trained, and on which data."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from pipeline.artifacts import read_attributes, read_csv, read_pairs
from pipeline.reporting.result_files import ABLATIONS


@dataclass(frozen=True)
class Training:
    """What one training cost and how it went."""

    scenario: str
    method: str
    budget: dict[str, Any]
    """``epochs``, ``steps``, ``batch_size``, ``train_pairs``, ``parameters``, ``best_epoch``."""
    curve: dict[str, list[float | None]]
    """Column by column; None where nothing was measured."""
    setting: str | None = None
    """Of an ablation's training, what it varies, as in ``fusion=target``; None for a main one."""


def read_trainings(folder: Path) -> list[Training]:
    """Read every ``<scenario>/<method>.json`` and the curve beside it, if there is one.

    So are the trainings of ablations, ``ablations/<name>/*.json``, which say themselves what they
    trained: ``scenario``, ``method`` and ``setting``.

    Raises:
        ValueError: A file is cut short or not what it should be.
    """
    main = [
        Training(file.parent.name, file.stem, _read_budget(file), _curve(file.with_suffix(".csv")))
        for file in sorted(folder.glob("*/*.json"))
        if file.parent.name != ABLATIONS
    ]
    return main + [_ablated(file) for file in sorted(folder.glob(f"{ABLATIONS}/*/*.json"))]


def _ablated(file: Path) -> Training:
    budget = _read_budget(file)
    names = [budget.get(key) for key in ("scenario", "method", "setting")]
    if not all(isinstance(name, str) for name in names):
        raise ValueError(f"{file} needs the names of scenario, method and setting, has {names}")
    scenario, method, setting = map(str, names)
    return Training(scenario, method, budget, _curve(file.with_suffix(".csv")), setting)


def _read_budget(file: Path) -> dict[str, Any]:
    try:
        budget = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file} needs a whole JSON object, got {error}") from None
    if not isinstance(budget, dict):
        raise ValueError(f"{file} needs a JSON object, got a {type(budget).__name__}")
    return budget


def _curve(file: Path) -> dict[str, list[float | None]]:
    if not file.exists():
        return {}
    header, rows = read_csv(file)
    missing = sorted({"epoch", "step", "loss"} - {*header})
    if missing:
        raise ValueError(f"{file} needs the columns {', '.join(missing)}, it lacks them")
    columns = zip(header, zip(*rows, strict=True), strict=bool(rows))
    return {name: [_maybe_number(text) for text in column] for name, column in columns}


def _maybe_number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


@dataclass(frozen=True)
class PairFacts:
    """What a pair file says about itself."""

    scenario: str
    source: str
    """Where the raw data came from: ``synthetic``, ``local``, ``download`` or ``unknown``."""
    unit: str
    seed: int
    schema: int
    test_pairs: int
    provenance: dict[str, Any]


def read_pair_facts(folder: Path, scenario: str) -> PairFacts:
    """Read what ``<scenario>.h5`` says about itself.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a pair file.
    """
    path = folder / f"{scenario}.h5"
    attributes = read_attributes(path)
    return PairFacts(
        scenario=scenario,
        source=str(attributes["provenance"].get("source", "unknown")),
        unit=str(attributes["unit"]),
        seed=int(attributes["seed"]),
        schema=int(attributes["schema"]),
        test_pairs=len(read_pairs(path, "test")),
        provenance=attributes["provenance"],
    )


def read_test_pair(
    folder: Path, scenario: str, pair: int
) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "m 3"]]:
    """Read source and target of one test pair of ``<scenario>.h5``, each in its own frame.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a pair file, or has no such pair.
    """
    path = folder / f"{scenario}.h5"
    test = read_pairs(path, "test")
    if not 0 <= pair < len(test):
        raise ValueError(f"{path} needs a test pair {pair}, it has {len(test)}")
    return test.source[pair].double().numpy(), test.target[pair].double().numpy()
