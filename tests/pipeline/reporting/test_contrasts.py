"""What is held against what."""

from pathlib import Path

import pytest

from pipeline.reporting.contrasts import Contrast, make_contrasts
from pipeline.reporting.result_files import read_results, read_times
from tests.pipeline.reporting.made_up_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)

UNSEEN = "modelnet40-unseen_objects"


@pytest.fixture(scope="module")
def contrasts(tmp_path_factory: pytest.TempPathFactory) -> list[Contrast]:
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, (UNSEEN, "kitti"), 4)
    return make_contrasts(read_results(folder / "results"), read_times(folder / "results"))


def settings(contrasts: list[Contrast], table: str, method: str) -> set[str]:
    return {c.setting for c in contrasts if (c.mine.table, c.mine.method) == (table, method)}


def test_ours_are_held_against_every_method_but_the_identity(contrasts: list[Contrast]) -> None:
    others = ("constant", "icp_centroid", "icp", "fgr", "pcrdiffusion_cf")
    expected = {f"paper minus {method}:paper" for method in others}
    assert settings(contrasts, "1a", "pcrdiffusion_cb") == expected
    assert settings(contrasts, "2", "pcrdiffusion_cb") == expected
    assert settings(contrasts, "1a", "icp") == set()


def test_each_setting_of_an_ablation_is_held_against_its_base(contrasts: list[Contrast]) -> None:
    assert settings(contrasts, "3", "pcrdiffusion_cf") == {"diffusion=with minus diffusion=without"}
    base = "representation=quaternion,scaling=raw"
    representation = settings(contrasts, "4", "pcrdiffusion_cb")
    assert len(representation) == 11
    assert {name.partition(" minus ")[2] for name in representation} == {base}
    steps = settings(contrasts, "7", "pcrdiffusion_cf")
    assert len(steps) == 9  # two samplers of five, less the base; no further draws
    assert {name.partition(" minus ")[2] for name in steps} == {"steps=1,sampler=ddpm"}
    assert settings(contrasts, "5", "pcrdiffusion_cf") == {
        "fusion=target minus fusion=source",
        "fusion=concat minus fusion=source",
        *(f"fusion={name} minus constant:paper" for name in ("source", "target", "concat")),
    }


def test_under_noise_methods_are_held_against_each_other_at_the_same_noise(
    contrasts: list[Contrast],
) -> None:
    noisy = settings(contrasts, "extra", "pcrdiffusion_cb")
    assert len(noisy) == 2 * 5
    assert "noise=0.02 minus fgr:noise=0.02" in noisy


def test_times_are_held_against_those_of_others(contrasts: list[Contrast]) -> None:
    timed = [c for c in contrasts if c.mine.table == "6"]
    assert {c.metrics for c in timed} == {("seconds",)}
    assert len(timed) == 2 * 6


def test_only_pairs_that_both_answered_are_compared(tmp_path: Path) -> None:
    for method, pairs in (("pcrdiffusion_cb", (0, 1, 2)), ("icp", (2, 1, 3))):
        rows = [
            {"pair": pair, "setting": "paper", "seconds": str(1.0 + pair), "peak_memory_mib": "1"}
            for pair in pairs
        ]
        write_rows(tmp_path / "times" / f"{method}.csv", rows)
    (one,) = make_contrasts([], read_times(tmp_path))
    mine, base = one.columns("seconds")
    assert mine.tolist() == base.tolist() == [2.0, 3.0]


def test_a_pair_on_which_either_failed_is_counted_once(tmp_path: Path) -> None:
    for method, failed in (("pcrdiffusion_cb", (0, 1)), ("icp", (1, 2))):
        rows = [plain_row(p) | {"failure": "none" if p in failed else ""} for p in range(4)]
        write_rows(result_file(tmp_path, "kitti", method), rows)
    (one,) = make_contrasts(read_results(tmp_path), [])
    assert one.failures == 3
