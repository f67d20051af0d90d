"""cosine_alphas_bar: its ends, its shape and a value worked by hand."""

import math

import pytest
import torch

from pcrdiff.diffusion.schedule import cosine_alphas_bar


@pytest.mark.parametrize("timesteps", [1, 2, 10, 1000])
def test_signal_falls_from_one_to_almost_nothing_and_stays_positive(timesteps: int) -> None:
    a = cosine_alphas_bar(timesteps)
    assert a.dtype == torch.float64
    assert len(a) == timesteps + 1
    assert a[0] == 1
    assert 0 < a[-1] < 2e-3  # the last step takes 0.999 at most
    assert (a.diff() < 0).all()


def test_no_step_takes_more_than_its_cap() -> None:
    a = cosine_alphas_bar(100, max_beta=0.2)
    assert (1 - a[1:] / a[:-1]).max() <= 0.2 + 1e-12


def test_the_middle_is_nichol_and_dhariwals() -> None:
    # Eq. 17 at t = T / 2, s = 0.008: cos^2((0.508 / 1.008) pi/2) / cos^2((0.008 / 1.008) pi/2)
    expected = (math.cos(0.508 / 1.008 * math.pi / 2) / math.cos(0.008 / 1.008 * math.pi / 2)) ** 2
    assert cosine_alphas_bar(1000)[500].item() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("timesteps", [0, -3])
def test_refuses_no_steps(timesteps: int) -> None:
    with pytest.raises(ValueError, match=f"timesteps >= 1, got {timesteps}"):
        cosine_alphas_bar(timesteps)
