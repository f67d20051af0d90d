"""The verdict: calibrated where the truth is known, modest where little is, and never infinite."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Bool, Float64
from scipy.special import expit

from pcrdiff.verdict import (
    BINS,
    PENALTY,
    Verdict,
    calibration_error,
    choose_threshold,
    fit_verdict,
    reliability_curve,
    trust_quality,
)

Drawn = tuple[Float64[np.ndarray, "pairs 2"], Bool[np.ndarray, " pairs"]]


def drawn(count: int, seed: int = 0) -> Drawn:
    """Evidence, and answers that are right with a probability that is logistic in it."""
    generator = np.random.default_rng(seed)
    evidence = generator.normal(size=(count, 2)) * [3.0, 0.01] + [5.0, 0.2]
    logit = 1.5 * (evidence[:, 0] - 5) / 3 - (evidence[:, 1] - 0.2) / 0.01 + 1
    return evidence, generator.random(count) < expit(logit)


def by_newton(evidence: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The probabilities of the same model, found in another way."""
    inputs = (evidence - evidence.mean(axis=0)) / evidence.std(axis=0)
    inputs = np.column_stack([inputs, np.ones(len(inputs))])
    labels = np.where(right, (right.sum() + 1) / (right.sum() + 2), 1 / ((~right).sum() + 2))
    penalty, w = np.diag([PENALTY] * evidence.shape[1] + [0.0]), np.zeros(inputs.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-inputs @ w))
        hessian = (inputs.T * p * (1 - p)) @ inputs + penalty
        w = w - np.linalg.solve(hessian, inputs.T @ (p - labels) + penalty @ w)
    return 1 / (1 + np.exp(-inputs @ w))


def test_the_fit_is_the_one_that_newtons_method_finds() -> None:
    evidence, right = drawn(120)
    found = fit_verdict(evidence, right).probability(evidence)
    np.testing.assert_allclose(found, by_newton(evidence, right), atol=1e-6)


def test_probabilities_are_true_on_answers_that_nothing_was_fitted_to() -> None:
    verdict, (evidence, right) = fit_verdict(*drawn(2000)), drawn(20000, seed=1)
    assert calibration_error(verdict.probability(evidence), right) < 0.02
    trusted = verdict.trusts(verdict.probability(evidence))
    quality = trust_quality(trusted, right)
    assert 0.1 < quality.trusted < 0.5
    assert quality.wrong_of_trusted < 0.03


def test_the_unit_and_the_zero_of_the_evidence_do_not_matter() -> None:
    evidence, right = drawn(150)
    moved = evidence * [1e3, -1e-3] + [7.0, 100.0]
    there = fit_verdict(moved, right).probability(moved)
    np.testing.assert_allclose(there, fit_verdict(evidence, right).probability(evidence), atol=1e-5)


@pytest.mark.parametrize(("hits", "misses"), [(20, 0), (0, 20), (1, 0), (0, 0)])
def test_answers_of_one_kind_give_the_probability_of_laplaces_rule(hits: int, misses: int) -> None:
    evidence, _ = drawn(hits + misses)
    verdict = fit_verdict(evidence, np.repeat([True, False], [hits, misses]))
    anything = np.array([[5.0, 0.2], [-1e3, 4.0]])
    expected = (hits + 1) / (hits + misses + 2)
    np.testing.assert_allclose(verdict.probability(anything), expected, atol=1e-6)
    assert (verdict.pairs, verdict.right, verdict.threshold) == (hits + misses, hits, None)


def test_only_many_right_answers_without_a_wrong_one_are_trusted_whatever_speaks_for_them() -> None:
    thresholds = {
        count: fit_verdict(drawn(count)[0], np.ones(count, bool)).threshold for count in (45, 55)
    }
    assert thresholds[45] is None
    assert thresholds[55] == pytest.approx(56 / 57)


@pytest.mark.parametrize("count", [2, 6, 200])
def test_what_evidence_separates_without_fail_leaves_coefficients_finite(count: int) -> None:
    evidence = np.column_stack([np.linspace(-1, 1, count), np.zeros(count)])
    verdict = fit_verdict(evidence, evidence[:, 0] > 0)
    assert np.abs(verdict.coefficients).max() < 20
    assert np.isfinite([*verdict.scale, verdict.intercept]).all()
    probability = verdict.probability(np.array([[-1.0, 0.0], [1.0, 0.0]]))
    assert probability[0] < 0.5 < probability[1] < 1


def test_a_number_that_never_varies_says_nothing() -> None:
    evidence, right = drawn(80)
    evidence[:, 1] = 0.1
    verdict = fit_verdict(evidence, right)
    assert verdict.coefficients[1] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(
        verdict.probability(evidence),
        fit_verdict(evidence[:, :1], right).probability(evidence[:, :1]),
        atol=1e-6,
    )


def test_pairs_without_an_answer_are_left_out_have_no_probability_and_no_trust() -> None:
    evidence, right = drawn(100)
    some = np.vstack([evidence, np.full((3, 2), np.nan)])
    verdict = fit_verdict(some, np.append(right, [True, False, True]))
    assert verdict == fit_verdict(evidence, right)
    probability = verdict.probability(some)
    assert np.isnan(probability[100:]).all()
    assert not replace(verdict, threshold=0.0).trusts(probability)[100:].any()


def test_nothing_is_trusted_without_a_threshold_and_everything_from_it_on_with_one() -> None:
    verdict = Verdict((0.0,), (1.0,), (1.0,), 0.0, None, 2, 1)
    probability = np.array([0.2, 0.5, 1.0])
    assert verdict.trusts(probability).tolist() == [False, False, False]
    assert replace(verdict, threshold=0.5).trusts(probability).tolist() == [False, True, True]


def thousand(*wrong: int) -> Bool[np.ndarray, "1000"]:
    """A thousand answers, the most probable first, of which some are wrong."""
    right = np.ones(1000, bool)
    right[list(wrong)] = False
    return right


def test_the_threshold_is_the_least_that_keeps_wrong_and_expected_wrong_small() -> None:
    probability = np.linspace(1.0, 0.999, 1000)
    assert choose_threshold(probability, thousand()) == 0.999
    assert choose_threshold(probability, thousand(*range(100, 130))) == probability[101]  # 2 of 102
    assert choose_threshold(probability, thousand(*range(100, 120))) == 0.999
    assert choose_threshold(probability, thousand(0)) == 0.999  # one of a thousand
    assert choose_threshold(probability[:40], thousand(0)[:40]) is None
    steep = np.linspace(1.0, 0.9, 1000)  # on average 2 % are expected to be wrong above 0.96
    assert choose_threshold(steep, thousand()) == pytest.approx(0.96, abs=1e-3)


def test_answers_of_equal_probability_are_trusted_together_or_not_at_all() -> None:
    probability = np.repeat([0.999, 0.99], 50)
    right = np.ones(100, bool)
    right[90:] = False
    assert choose_threshold(probability, right) == 0.999
    assert choose_threshold(probability[50:], right[50:]) is None


def test_the_order_of_the_answers_does_not_matter() -> None:
    evidence, right = drawn(300)
    order = np.random.default_rng(3).permutation(300)
    one, other = fit_verdict(evidence, right), fit_verdict(evidence[order], right[order])
    assert one.threshold == pytest.approx(other.threshold, abs=1e-6)


def test_the_reliability_curve_and_its_error_are_worked_by_hand() -> None:
    probability = np.array([0.0, 0.02, 0.5, 0.9, 1.0])
    right = np.array([False, True, True, True, False])
    curve = reliability_curve(probability, right)
    np.testing.assert_allclose(curve.predicted, [0.01, 0.5, 0.9, 1.0])
    assert curve.observed.tolist() == [0.5, 1.0, 1.0, 0.0]
    assert curve.counts.tolist() == [2, 1, 1, 1]
    expected = (2 * 0.49 + 0.5 + 0.1 + 1.0) / 5
    assert calibration_error(probability, right) == pytest.approx(expected)


def test_the_edges_of_the_bins_are_fifteenths_and_no_answer_is_lost() -> None:
    probability = np.arange(BINS) / BINS + 0.01
    assert len(reliability_curve(probability, probability > 0.5).counts) == BINS == 15
    assert reliability_curve(np.ones(4), np.ones(4, bool)).counts.tolist() == [4]
    assert calibration_error(np.empty(0), np.empty(0, bool)) == 0


def test_trust_is_counted_by_hand_also_for_several_draws_at_once() -> None:
    trusted = np.array([[True, True, True, False], [False, False, False, False]])
    right = np.array([[True, True, False, True], [True, False, False, False]])
    quality = trust_quality(trusted, right)
    np.testing.assert_allclose(quality.trusted, [0.75, 0])
    np.testing.assert_allclose(quality.wrong_of_trusted, [1 / 3, 0])
    np.testing.assert_allclose(quality.trusted_of_right, [2 / 3, 0])
