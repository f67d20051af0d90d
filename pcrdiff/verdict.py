"""How far an answer can be trusted: the probability that it is right, from what speaks for it."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy.optimize import minimize
from scipy.special import expit

Evidence = Float64[np.ndarray, "pairs numbers"]
Probabilities = Float64[np.ndarray, " pairs"]
Flags = Bool[np.ndarray, " pairs"]
PENALTY = 0.3
"""On half the squared norm of the coefficients of standardized evidence: weak, yet never without."""
MOST_WRONG = 0.02
"""Of the answers that are trusted."""
BINS = 15
"""Of equal width, from 0 to 1."""


@dataclass(frozen=True)
class Verdict:
    """A logistic model of whether an answer is right, and from where on it is trusted."""

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    """Of each number of the evidence: what is subtracted, and then divided by."""
    coefficients: tuple[float, ...]
    intercept: float
    threshold: float | None
    """The least probability that is trusted; None where nothing is."""
    pairs: int
    """With an answer, on which this was fitted."""
    right: int
    """How many of those answers were right."""

    def probability(self, evidence: Evidence) -> Probabilities:
        """That each answer is right; NaN where its evidence is."""
        standard = (evidence - np.array(self.mean)) / np.array(self.scale)
        return np.asarray(expit(standard @ np.array(self.coefficients) + self.intercept))

    def trusts(self, probability: Probabilities) -> Flags:
        """Whether each answer is trusted; never one without a probability."""
        return probability >= (np.inf if self.threshold is None else self.threshold)


def fit_verdict(evidence: Evidence, right: Flags) -> Verdict:
    """Fit a verdict to answers whose truth is known; those without evidence (NaN) are left out.

    Logistic regression with an L2 penalty. The labels are not 0 and 1 but Platt's (1999): the
    shares that Laplace's rule gives wrong and right answers. So all coefficients stay finite, and
    where all answers are right, or all wrong, the probability is that of Laplace's rule.
    """
    answered = np.isfinite(evidence).all(axis=1)
    evidence, right = evidence[answered], right[answered]
    mean, scale = np.zeros(evidence.shape[1]), np.ones(evidence.shape[1])
    if len(evidence):
        mean, spread = evidence.mean(axis=0), evidence.std(axis=0)
        scale = np.where(spread > 1e-12 * np.abs(mean), spread, 1.0)
    weights = _fit_logistic((evidence - mean) / scale, _smoothed(right))
    model = Verdict(
        tuple(mean.tolist()),
        tuple(scale.tolist()),
        tuple(weights[:-1].tolist()),
        float(weights[-1]),
        threshold=None,
        pairs=len(right),
        right=int(right.sum()),
    )
    threshold = choose_threshold(model.probability(evidence), right)
    return replace(model, threshold=threshold)


def _smoothed(right: Flags) -> Probabilities:
    """Platt's labels: the share of right answers to expect beside so many that were, or were not."""
    hits, misses = int(right.sum()), int((~right).sum())
    return np.where(right, (hits + 1) / (hits + 2), 1 / (misses + 2))


def _fit_logistic(
    inputs: Evidence, labels: Probabilities
) -> Float64[np.ndarray, " numbers_and_one"]:
    """Coefficients and, last, the intercept, which is not penalized."""
    inputs = np.column_stack([inputs, np.ones(len(inputs))])
    penalty = np.append(np.full(inputs.shape[1] - 1, PENALTY), 0.0)

    def loss(
        w: Float64[np.ndarray, " numbers_and_one"],
    ) -> tuple[float, Float64[np.ndarray, " numbers_and_one"]]:
        z = inputs @ w
        entropy = float((np.logaddexp(0, z) - labels * z).sum())
        gradient = inputs.T @ (expit(z) - labels) + penalty * w
        return entropy + float(penalty @ w**2) / 2, gradient

    start = np.zeros(inputs.shape[1])
    return np.asarray(minimize(loss, start, jac=True, options={"gtol": 1e-8}).x)


def choose_threshold(probability: Probabilities, right: Flags) -> float | None:
    """Find the least probability from which on at most ``MOST_WRONG`` of the answers are wrong.

    Both the share of those that were wrong and the share that the probabilities expect to be wrong
    have to be as small, so that a few lucky pairs raise no trust: it takes about fifty right answers
    for a smoothed probability that is high enough. None where there is none.
    """
    order = np.argsort(-probability, kind="stable")
    probability, right = probability[order], right[order]
    counts = np.arange(1, len(right) + 1)
    were, expected = (np.cumsum(wrong) / counts for wrong in (~right, 1 - probability))
    last_of_equals = np.append(probability[1:] < probability[:-1], True)[: len(right)]
    fits = np.flatnonzero((np.maximum(were, expected) <= MOST_WRONG) & last_of_equals)
    return float(probability[fits[-1]]) if len(fits) else None


class Reliability(NamedTuple):
    """What became of answers of about the same probability; a row for each bin that has some."""

    predicted: Float64[np.ndarray, " bins"]
    """The mean probability."""
    observed: Float64[np.ndarray, " bins"]
    """The share of right answers."""
    counts: Int64[np.ndarray, " bins"]


def reliability_curve(probability: Probabilities, right: Flags) -> Reliability:
    """Sort answers by their probability into ``BINS``; 1 belongs to the last."""
    number = np.minimum((probability * BINS).astype(int), BINS - 1)
    counts, hits, sums = (
        np.bincount(number, weights, BINS) for weights in (None, right, probability)
    )
    some = counts > 0
    return Reliability(sums[some] / counts[some], hits[some] / counts[some], counts[some])


def calibration_error(probability: Probabilities, right: Flags) -> float:
    """Expected calibration error: the mean gap of predicted and observed share over the bins.

    A bin counts as often as it has answers (Naeini et al. 2015). 0 without answers.
    """
    curve = reliability_curve(probability, right)
    return float(np.abs(curve.predicted - curve.observed) @ curve.counts / max(1, len(right)))


Judged = Bool[np.ndarray, "*batch pairs"]
Shares = Float64[np.ndarray, "*batch"]


class Trust(NamedTuple):
    """How good trust is; a share of no answers is 0."""

    trusted: Shares
    """Share of the answers."""
    wrong_of_trusted: Shares
    """Share of the trusted that are wrong: one minus the precision."""
    trusted_of_right: Shares
    """Share of the right ones that are trusted: the recall."""


def trust_quality(trusted: Judged, right: Judged) -> Trust:
    """Say of answers how many are trusted, how many of those wrongly, and how many right ones."""
    everything = np.ones_like(trusted)
    return Trust(
        _share(trusted, everything),
        _share(trusted & ~right, trusted),
        _share(trusted & right, right),
    )


def _share(some: Judged, of: Judged) -> Shares:
    return np.asarray(some.sum(axis=-1) / np.maximum(1, of.sum(axis=-1)))
