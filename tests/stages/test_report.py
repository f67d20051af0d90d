"""The report stage, end to end on synthetic results."""

import json
from pathlib import Path

import pandas as pd
import pytest

from stages.report import main
from tests.pipeline.reporting.synthetic_results import (
    make_report_inputs,
    result_file,
    write_everything,
)

SCENARIOS = ("modelnet40-unseen_objects", "kitti")
PICTURES = ["pair_kitti", "pair_modelnet40", "panels_kitti", "panels_modelnet40"]
FILES = [
    *(f"figures/{name}.png" for name in PICTURES),
    "index.html",
    "summary.json",
    "tables/results.csv",
    "tables/results.md",
    "tables/results.tex",
]


pytestmark = pytest.mark.usefixtures("report_project")


def contents(folder: Path) -> dict[str, bytes]:
    return {
        file.relative_to(folder).as_posix(): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_writes_every_output_and_the_same_bytes_twice(tmp_path: Path) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    once = contents(tmp_path / "reports")
    main(make_report_inputs(tmp_path))
    assert sorted(once) == FILES  # and no temporary file is left
    assert contents(tmp_path / "reports") == once


def test_the_summary_holds_the_errors_of_cf_and_cb_to_four_digits_and_nothing_else(
    tmp_path: Path,
) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    table = tmp_path / "reports" / "tables" / "results.csv"
    rows = pd.read_csv(table, dtype={"table": str})
    rows = rows[(rows["setting"] == "paper") & (rows["subset"] == "all")]
    rows = rows[(rows["metric"] == "error_r_deg") & rows["table"].isin(["1a", "2"])]
    found = rows.set_index(["method", "scenario"])["value"]
    expected = {
        short: {
            name: float(f"{found[f'pcrdiffusion_{short}', scenario]:.4g}")
            for name, scenario in (("kitti", "kitti"), ("unseen_objects", SCENARIOS[0]))
        }
        for short in ("cf", "cb")
    }
    summary = json.loads((tmp_path / "reports" / "summary.json").read_text())
    assert summary == expected
    notes = [
        event["values"]
        for file in (tmp_path / "project").rglob("*.jsonl")
        for event in map(json.loads, file.read_text().splitlines())
        if event["event"] == "metrics"
    ]
    noted = {name: value for values in notes for name, value in values.items()}
    assert noted == {f"{m}.{s}": v for m, errors in expected.items() for s, v in errors.items()}


def test_a_cut_result_leaves_the_last_report_as_it_was(tmp_path: Path) -> None:
    write_everything(tmp_path, SCENARIOS, 4)
    main(make_report_inputs(tmp_path))
    before = contents(tmp_path / "reports")
    file = result_file(tmp_path / "results", "kitti", "icp")
    file.write_bytes(file.read_bytes()[:-30])
    with pytest.raises(ValueError, match=r"icp/kitti\.csv needs"):
        main(make_report_inputs(tmp_path))
    assert contents(tmp_path / "reports") == before


def test_an_empty_folder_of_results_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="results needs a <method>/<scenario>"):
        main(make_report_inputs(tmp_path))
