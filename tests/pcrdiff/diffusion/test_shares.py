"""Shares of a batch: together they are the batch, and they draw what it draws."""

import pytest
import torch

from pcrdiff.diffusion.process import corrupt
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from pcrdiff.diffusion.shares import Share, SharedGenerator, rows_drawn


def shares(batch: int, processes: int) -> list[Share]:
    return [Share(batch, rank, processes) for rank in range(processes)]


@pytest.mark.parametrize("batch", [1, 2, 7, 8])
@pytest.mark.parametrize("processes", [1, 2, 3])
def test_each_row_is_held_once_and_the_weights_are_those_of_a_mean(
    batch: int, processes: int
) -> None:
    rows = torch.arange(batch)
    held = [rows[share.rows] for share in shares(batch, processes) if share.count]
    assert sorted(torch.cat(held).tolist()) == rows.tolist()
    assert [share.count for share in shares(batch, processes) if share.count] == list(
        map(len, held)
    )
    values = torch.rand(batch, dtype=torch.float64)
    parts = [share.weight * values[share.rows].mean() for share in shares(batch, processes)]
    torch.testing.assert_close(torch.stack(parts).sum(), values.mean())


def test_a_process_without_a_row_stands_in_with_one_that_weighs_nothing() -> None:
    share = Share(batch=1, rank=1, processes=2)
    assert (share.count, share.weight) == (0, 0.0)
    assert torch.arange(1)[share.rows].tolist() == [0]


@pytest.mark.parametrize("batch", [1, 5, 16, 33])  # torch fills 16 numbers and more in blocks
@pytest.mark.parametrize("processes", [2, 3])
def test_the_noise_of_a_share_is_that_of_its_rows_in_the_whole_batch(
    batch: int, processes: int
) -> None:
    alphas_bar = cosine_alphas_bar(20)
    x_0 = torch.randn(batch, 7)
    plain = torch.Generator().manual_seed(3)
    whole = [corrupt(x_0, alphas_bar, generator=plain) for _ in range(2)]  # two batches in a row
    for share in shares(batch, processes):
        generator = SharedGenerator()
        generator.manual_seed(3)
        generator.share = share
        for x_t, t in whole:
            own_x_t, own_t = corrupt(x_0[share.rows], alphas_bar, generator=generator)
            assert torch.equal(own_x_t, x_t[share.rows])
            assert torch.equal(own_t, t[share.rows])


def test_whoever_holds_the_whole_batch_draws_for_it_alone() -> None:
    assert rows_drawn(5, torch.Generator()) == (5, slice(None))
    assert rows_drawn(5, SharedGenerator()) == (5, slice(None))
