"""What is held against what."""

from pathlib import Path

import pandas as pd
import pytest

from pipeline.reporting.contrasts import pick_contrasts
from pipeline.reporting.difficulty import measure_difficulty
from pipeline.reporting.numbers import make_numbers
from pipeline.reporting.reading import read_answers, read_times
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)

UNSEEN = "modelnet40-unseen_objects"


@pytest.fixture(scope="module")
def contrasts(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, (UNSEEN, "kitti"), 4)
    return pick_contrasts(read_answers(folder / "results"), read_times(folder / "results"))


def bases(contrasts: pd.DataFrame, table: str, method: str) -> set[tuple[str, str, str]]:
    """Own setting, and method and setting of the base, of a method's contrasts in a table."""
    here = contrasts[(contrasts["table"] == table) & (contrasts["method"] == method)]
    return {*zip(here["setting"], here["method_base"], here["setting_base"], strict=True)}


def test_ours_are_held_against_every_method_but_the_identity(contrasts: pd.DataFrame) -> None:
    others = ("constant", "icp_centroid", "icp", "fgr", "pcrdiffusion_cf")
    expected = {("paper", method, "paper") for method in others}
    assert bases(contrasts, "1a", "pcrdiffusion_cb") == expected
    assert bases(contrasts, "2", "pcrdiffusion_cb") == expected
    assert bases(contrasts, "1a", "icp") == set()


def test_each_setting_of_an_ablation_is_held_against_its_base(contrasts: pd.DataFrame) -> None:
    cf, cb = "pcrdiffusion_cf", "pcrdiffusion_cb"
    assert bases(contrasts, "3", cf) == {("diffusion=with", cf, "diffusion=without")}
    representation = bases(contrasts, "4", cb)
    assert len(representation) == 11
    assert {base[1:] for base in representation} == {(cb, "representation=quaternion,scaling=raw")}
    steps = bases(contrasts, "7", cf)
    assert len(steps) == 9  # two samplers of five, less the base; no further draws
    assert {base[1:] for base in steps} == {(cf, "steps=1,sampler=ddpm")}
    assert bases(contrasts, "5", cf) == {
        ("fusion=target", cf, "fusion=source"),
        ("fusion=concat", cf, "fusion=source"),
        *((f"fusion={name}", "constant", "paper") for name in ("source", "target", "concat")),
    }


def test_under_noise_methods_are_held_against_each_other_at_the_same_noise(
    contrasts: pd.DataFrame,
) -> None:
    noisy = bases(contrasts, "extra", "pcrdiffusion_cb")
    assert len(noisy) == 2 * 5
    assert ("noise=0.02", "fgr", "noise=0.02") in noisy


def test_times_are_held_against_those_of_others(contrasts: pd.DataFrame) -> None:
    timed = contrasts[contrasts["table"] == "6"]
    assert {*timed["metrics"]} == {("seconds",)}
    assert len(timed) == 2 * 6


def contrast_of(folder: Path, metric: str) -> pd.Series:
    """The one contrast of a metric in a folder of results."""
    answers, times = read_answers(folder), read_times(folder)
    numbers = make_numbers(answers, times, measure_difficulty({}), seed=0)
    found = numbers[(numbers["kind"] == "contrast") & (numbers["metric"] == metric)]
    assert len(found) == 1
    return found.iloc[0]


def test_only_pairs_that_both_answered_are_compared(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", "identity"), [plain_row(0)])
    for method, off, pairs in (("pcrdiffusion_cb", 1.0, (0, 1, 2)), ("icp", 3.0, (2, 1, 3))):
        rows = [
            {"pair": k, "setting": "paper", "seconds": str(off + k), "peak_memory_mib": "1"}
            for k in pairs
        ]
        write_rows(tmp_path / "times" / f"{method}.csv", rows)
    found = contrast_of(tmp_path, "seconds")
    assert (found["pairs"], found["value"], found["low"], found["high"]) == (2, -2.0, -2.0, -2.0)


def test_a_pair_on_which_either_failed_is_counted_once(tmp_path: Path) -> None:
    for method, failed in (("pcrdiffusion_cb", (0, 1)), ("icp", (1, 2))):
        rows = [plain_row(p) | {"failure": "none" if p in failed else ""} for p in range(4)]
        write_rows(result_file(tmp_path, "kitti", method), rows)
    assert contrast_of(tmp_path, "error_r_deg")["failures"] == 3
