"""Read what stands behind the numbers: how a method was trained, and on which data."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcrdiff.registration import Pairs
from pipeline.formats.files import read_csv
from pipeline.formats.pairs import read_attributes, read_pairs
from pipeline.formats.weights import CURVE, FACTS
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
    settings: tuple[str, ...] = ()
    """Of an ablation's training, under which settings tables show it; empty for a main one."""

    @property
    def setting(self) -> str | None:
        """What an ablation's training is, as in ``fusion=target``; None for a main one."""
        return self.settings[0] if self.settings else None


def read_trainings(folder: Path) -> list[Training]:
    """Read every ``facts.json`` under ``folder`` and the ``curve.csv`` beside it, if there is one.

    Those of ablations come last.

    Raises:
        ValueError: A file is cut short or not what it should be.
    """
    found = [_read_training(folder, file) for file in sorted(folder.glob(f"**/{FACTS}"))]
    return sorted(found, key=lambda one: one.setting is not None)


def _read_training(folder: Path, file: Path) -> Training:
    budget, ablated = _read_budget(file), file.is_relative_to(folder / ABLATIONS)
    scenario, method, settings = (budget.get(key) for key in ("scenario", "method", "settings"))
    if not isinstance(scenario, str) or not isinstance(method, str):
        raise ValueError(f"{file} needs the names of scenario, method, has {[scenario, method]}")
    if ablated != bool(settings) or not all(isinstance(one, str) for one in settings or []):
        raise ValueError(
            f"{file} needs the names of its settings if of an ablation, has {settings}"
        )
    return Training(scenario, method, budget, _curve(file.with_name(CURVE)), tuple(settings or ()))


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


@dataclass(frozen=True)
class PairFile:
    """What a report needs of a pair file, read once."""

    facts: PairFacts
    test: Pairs


def read_pair_files(folder: Path, scenarios: Iterable[str]) -> dict[str, PairFile]:
    """Read what each ``<scenario>.h5`` says about itself, and its test pairs.

    Raises:
        FileNotFoundError: A scenario has no pair file.
        ValueError: A file is not a pair file.
    """
    return {name: _read_pair_file(folder / f"{name}.h5", name) for name in sorted({*scenarios})}


def _read_pair_file(path: Path, scenario: str) -> PairFile:
    attributes, test = read_attributes(path), read_pairs(path, "test")
    facts = PairFacts(
        scenario=scenario,
        source=str(attributes["provenance"].get("source", "unknown")),
        unit=str(attributes["unit"]),
        seed=int(attributes["seed"]),
        schema=int(attributes["schema"]),
        test_pairs=len(test),
        provenance=attributes["provenance"],
    )
    return PairFile(facts, test)
