"""How far the answers of a method can be trusted: learned from its answers to validation pairs."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Bool

from pcrdiff.evaluation import Estimates, Verifying
from pcrdiff.geometry.metrics import is_right
from pcrdiff.registration import Method, Pairs
from pcrdiff.verdict import Verdict, fit_verdict
from pipeline.answering import answer_all
from pipeline.formats.pairs import read_pairs
from pipeline.settings.params import Params


def learn_verdicts(
    params: Params, settings: Mapping[str, Method], pairs: Path
) -> dict[str, Verdict]:
    """Register the validation pairs of a scenario, and fit a verdict to the answers.

    The draws are others than those at the test.

    Returns:
        By setting, of those that say what speaks for their answers.

    Raises:
        FileNotFoundError, ValueError: The pair file is not there or not what it should be.
    """
    verified = {
        name: (method, 0) for name, method in settings.items() if isinstance(method, Verifying)
    }
    if not verified:
        return {}
    known = read_pairs(pairs, "val")
    answers = answer_all(params, verified, known, purpose="validate")
    return {
        name: fit_verdict(given.evidence.numpy(), _right(given, known))
        for name, given in answers.items()
        if given.evidence is not None
    }


def _right(given: Estimates, known: Pairs) -> Bool[np.ndarray, " pairs"]:
    return np.asarray(is_right(given.T_target_source, known.T_target_source))
