"""What the report says of itself: its warning, and the numbers that DVC compares."""

from dataclasses import replace
from pathlib import Path

from pipeline.reporting.report import banner, make_contents, make_report, summarise
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)
from tests.pipeline.reporting.test_numbers import UNSEEN, numbers_of
from tests.pipeline.reporting.test_tables import file_of


def test_only_the_paper_profile_on_real_data_goes_without_a_banner() -> None:
    real, synthetic = file_of(source="download"), file_of("kitti")
    assert banner("paper", [real]) is None
    assert banner("paper", [real, synthetic]) == (
        "paper profile: not a reproduction (synthetic data: KITTI)"
    )
    assert banner("cpu", [real]) == "cpu profile: not a reproduction"
    assert banner("paper", [replace(real, source="unknown")]) is not None


def test_the_summary_is_of_the_headline_settings(tmp_path: Path) -> None:
    rows = [
        plain_row(0, off_deg=k) | {"setting": s} for k, s in ((1.23456, "paper"), (9, "official"))
    ]
    write_rows(result_file(tmp_path, UNSEEN, "pcrdiffusion_cb"), rows)
    write_rows(result_file(tmp_path, "kitti", "pcrdiffusion_cb"), rows[1:])
    write_rows(result_file(tmp_path, "kitti", "icp"), rows[1:])
    expected = {"cf": {}, "cb": {"kitti": 18.0, "unseen_objects": 2.469}}
    assert summarise(numbers_of(tmp_path)) == expected


def test_a_report_holds_every_document_and_a_picture_of_each_kind(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    parts = (tmp_path / name for name in ("results", "models", "pairs", "benchmarks"))
    report = make_report(make_contents(*parts, profile="quick"))
    assert [*report.tables] == ["results.csv", "results.md", "results.tex"]
    assert [*report.pictures] == ["pair_kitti.png", "panels_kitti.png"]
    assert {*report.summary} == {"cf", "cb"}
