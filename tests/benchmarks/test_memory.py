"""The benchmark of memory: what it registers, and that it measures processes of their own."""

import torch

from benchmarks.memory import make_clouds, measure_memory


def test_the_target_is_the_source_moved() -> None:
    source, target = make_clouds(50, 3)
    assert source.shape == target.shape == (1, 50, 3)
    spreads = [(cloud - cloud.mean(dim=1)).norm(dim=-1).sort().values for cloud in (source, target)]
    torch.testing.assert_close(*spreads, atol=1e-5, rtol=0)
    assert not torch.allclose(source, target, atol=0.1)


def test_a_row_is_a_registration_in_a_process_of_its_own() -> None:
    (row,) = measure_memory("pcrdiffusion_cb", (40,), "")
    assert row.points == 40
    assert row.seconds > 0
    assert row.peak_mib > 100  # torch alone
    ballast = torch.ones(150_000_000)  # of this process; how much of a library is resident varies
    (beside,) = measure_memory("pcrdiffusion_cb", (40,), "")
    assert beside.peak_mib < row.peak_mib + 400 < row.peak_mib + len(ballast) * 4 / 2**20
