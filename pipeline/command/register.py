"""``pcrdiff register``: two files in, a pose and its verdict out."""

import json
from pathlib import Path
from typing import cast

import numpy as np

import pcrdiff
from pcrdiff.any_clouds import Choice, Registration
from pipeline.formats.files import write_atomically


def register_files(
    source: Path, target: Path, output: Path | None, method: str, *, as_json: bool, seed: int
) -> tuple[list[str], bool]:
    """Register two files.

    Returns:
        The lines to print, and whether the answer is trusted.

    Raises:
        FileNotFoundError, ValueError: As :func:`pcrdiff.register`, or there is no such method.
    """
    found = pcrdiff.register(source, target, method=cast(Choice, method), seed=seed)
    if output:
        write_atomically(output, ("\n".join(_rows(found)) + "\n").encode())
    return [_as_json(found)] if as_json else [_in_words(found), *_rows(found)], _trusted(found)


def _trusted(found: Registration) -> bool:
    return found.verdict == "trust"


def _in_words(found: Registration) -> str:
    return (
        f"{found.verdict}: right with probability {found.probability:.2f}, overlap "
        f"{100 * found.overlap:.0f} %, RMSE {found.rmse:.3g}, {found.seconds:.1f} s, starts from "
        f"{found.method}"
    )


def _rows(found: Registration) -> list[str]:
    """The pose, to the last digit."""
    return [" ".join(repr(float(value)) for value in row) for row in found.T_target_source]


def _as_json(found: Registration) -> str:
    values = {**vars(found), "T_target_source": np.asarray(found.T_target_source).tolist()}
    return json.dumps(values)
