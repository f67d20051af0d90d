"""The Gaussian process: corrupting by hand, and the posterior computed another way."""

from itertools import pairwise
from math import sqrt

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcrdiff.diffusion.process import corrupt, ddim_step, q_posterior, q_sample, time_pairs
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from tests.pcrdiff.synthetic_clouds import seeded

T = 60
A = cosine_alphas_bar(T)


def draws(count: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    x_0, noise = torch.randn(2, count, 7, generator=seeded(seed), dtype=torch.float64)
    return x_0, noise


def test_time_zero_changes_nothing() -> None:
    x_0, noise = draws(4)
    assert torch.equal(q_sample(x_0, torch.zeros(4, dtype=torch.long), noise, A), x_0)


def test_every_vector_is_corrupted_to_its_own_time() -> None:
    alphas_bar = torch.tensor([1.0, 0.64, 0.36], dtype=torch.float64)
    x_0, noise = torch.tensor([[10.0], [10.0]]), torch.tensor([[1.0], [1.0]])
    x_t = q_sample(x_0, torch.tensor([1, 2]), noise, alphas_bar)
    torch.testing.assert_close(x_t, torch.tensor([[8.6], [6.8]]))  # Eq. 6: 8 + 0.6, 6 + 0.8


def test_corrupting_draws_every_time_but_zero_and_follows_the_seed() -> None:
    x_0 = torch.zeros(4000, 7)
    x_t, t = corrupt(x_0, cosine_alphas_bar(5), generator=seeded(1))
    assert sorted(set(t.tolist())) == [1, 2, 3, 4, 5]
    deviation = (1 - cosine_alphas_bar(5)).sqrt()
    for time in range(1, 6):
        assert x_t[t == time].std().item() == pytest.approx(deviation[time].item(), rel=0.05)
    again, t_again = corrupt(x_0, cosine_alphas_bar(5), generator=seeded(1))
    assert torch.equal(x_t, again)
    assert torch.equal(t, t_again)


def posterior_by_conditioning(
    x_0: torch.Tensor, x_t: torch.Tensor, t: int, s: int
) -> tuple[torch.Tensor, float]:
    """Run the chain one step at a time from s to t, then condition the joint Gaussian on x_t.

    Given x_0, (x_s, x_t) is normal; its moments follow from x_u = sqrt(1 - b) x_(u-1) + sqrt(b) e.
    """
    mean_s, variance_s = sqrt(A[s].item()) * x_0, 1 - A[s].item()
    mean_t, variance_t, covariance = mean_s, variance_s, variance_s
    for u in range(s + 1, t + 1):
        kept = (A[u] / A[u - 1]).item()
        mean_t = sqrt(kept) * mean_t
        variance_t = kept * variance_t + 1 - kept
        covariance = sqrt(kept) * covariance
    gain = covariance / variance_t
    return mean_s + gain * (x_t - mean_t), sqrt(max(variance_s - gain * covariance, 0.0))


@given(
    times=st.tuples(st.integers(0, T), st.integers(0, T)).filter(lambda pair: pair[0] != pair[1])
)
def test_the_posterior_over_skipped_steps_is_that_of_the_chain(times: tuple[int, int]) -> None:
    s, t = sorted(times)
    x_0, x_t = draws(3)
    mean, deviation = q_posterior(x_0, x_t, t, s, A)
    expected_mean, expected_deviation = posterior_by_conditioning(x_0, x_t, t, s)
    torch.testing.assert_close(mean, expected_mean, atol=1e-9, rtol=1e-9)
    assert deviation == pytest.approx(expected_deviation, abs=1e-7)


def test_a_single_step_is_the_posterior_of_ddpm() -> None:
    x_0, x_t = draws(3)
    t, beta = 20, 1 - (A[20] / A[19]).item()  # Ho et al. 2020, Eqs. 6-7
    mean = A[19].sqrt() * beta * x_0 + sqrt(1 - beta) * (1 - A[19]) * x_t
    expected, deviation = q_posterior(x_0, x_t, t, t - 1, A)
    torch.testing.assert_close(expected, mean / (1 - A[20]))
    assert deviation**2 == pytest.approx(((1 - A[19]) / (1 - A[20]) * beta).item())


@pytest.mark.parametrize("t", [1, 7, T])
def test_the_posterior_at_time_zero_is_x_0_itself(t: int) -> None:
    x_0, x_t = draws(3)
    mean, deviation = q_posterior(x_0, x_t, t, 0, A)
    torch.testing.assert_close(mean, x_0, atol=1e-12, rtol=0)
    assert deviation == 0


@pytest.mark.parametrize(("t", "s"), [(5, 5), (4, 5), (5, -1), (0, 0)])
def test_the_posterior_refuses_a_step_that_does_not_go_back(t: int, s: int) -> None:
    x_0, x_t = draws(1)
    with pytest.raises(ValueError, match=f"0 <= s < t, got s = {s}, t = {t}"):
        q_posterior(x_0, x_t, t, s, A)


@pytest.mark.parametrize(("t", "s"), [(T, 30), (30, 29), (1, 0), (T, 0)])
def test_ddim_with_the_exact_x_0_keeps_the_noise(t: int, s: int) -> None:
    x_0, noise = draws(3)
    x_t = q_sample(x_0, torch.full((3,), t), noise, A)
    x_s = q_sample(x_0, torch.full((3,), s), noise, A)
    torch.testing.assert_close(ddim_step(x_0, x_t, t, s, A), x_s)


def test_one_step_goes_all_the_way() -> None:
    assert time_pairs(1000, 1) == [(1000, 0)]


def test_as_many_steps_as_times_visit_them_all() -> None:
    assert time_pairs(5, 5) == [(5, 4), (4, 3), (3, 2), (2, 1), (1, 0)]
    assert time_pairs(1000, 4) == [(1000, 750), (750, 500), (500, 250), (250, 0)]


def test_quadratic_times_crowd_towards_zero_and_never_meet() -> None:
    assert time_pairs(1000, 4, "quadratic") == [(1000, 562), (562, 250), (250, 62), (62, 0)]
    for timesteps in (20, 1000):
        for steps in range(1, 21):
            pairs = time_pairs(timesteps, steps, "quadratic")
            times = [timesteps, *(s for _, s in pairs)]
            assert all(t > s for t, s in pairwise(times))
            assert times[-1] == 0


def test_steps_are_even_strictly_falling_and_joined() -> None:
    for timesteps in range(1, 40):
        for steps in range(1, timesteps + 1):
            pairs = time_pairs(timesteps, steps)
            assert len(pairs) == steps
            assert (pairs[0][0], pairs[-1][1]) == (timesteps, 0)
            assert all(t == s for (_, s), (t, _) in pairwise(pairs))
            assert all(abs((t - s) - timesteps / steps) <= 1 for t, s in pairs)
            assert all(t > s for t, s in pairs)


@pytest.mark.parametrize("steps", [0, -1, 6])
def test_refuses_no_steps_and_more_than_there_are_times(steps: int) -> None:
    with pytest.raises(ValueError, match=f"1 <= steps <= 5, got {steps}"):
        time_pairs(5, steps)
