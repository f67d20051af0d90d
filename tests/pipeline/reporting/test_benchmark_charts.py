"""Figures of what `make bench` measured, and the page's section about it."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from pipeline.formats.benchmarks import Benchmarks, write_benchmarks
from pipeline.reporting.benchmark_charts import (
    benchmark_charts,
    ceilings_chart,
    latency_chart,
    latency_rows,
    memory_chart,
)
from pipeline.reporting.page import Contents, render_page
from pipeline.reporting.paper import METHODS
from pipeline.reporting.report import make_contents as make_the_contents
from pipeline.reporting.report import make_report
from tests.pipeline.reporting.synthetic_benchmarks import HERE, make_benchmarks
from tests.pipeline.reporting.synthetic_page import make_contents
from tests.pipeline.reporting.synthetic_results import write_everything

FOUND = make_benchmarks()


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return replace(make_contents(tmp_path_factory.mktemp("full"), ("kitti",), 3), benchmarks=None)


def section(page: str) -> str:
    """The page's part about benchmarks."""
    start = page.index('<section id="benchmarks">')
    return page[start : page.index("</section>", start)]


def test_every_method_stands_at_its_latency_and_error() -> None:
    figure = latency_chart(latency_rows(FOUND))
    assert figure.layout.xaxis.type == "log"
    drawn = {trace.meta: (trace.x[0], trace.y[0]) for trace in figure.data}
    assert drawn.keys() == METHODS.keys()
    assert drawn["icp"] == (2.0 * 1.5**3, 2.5)


def test_a_part_of_the_points_is_named_and_hollow() -> None:
    rows = latency_rows(FOUND)
    part = rows[rows["method"] == "pcrdiffusion_cf"]
    assert part["points"].tolist() == [2048, 512]
    assert part["name"].tolist() == ["PCRDiffusion CF", "PCRDiffusion CF, first 512 points"]
    (trace,) = [t for t in latency_chart(rows).data if "first" in t.name]
    assert trace.marker.symbol.endswith("-open")
    assert [*dict.fromkeys(rows["method"])] == [*METHODS]


def test_another_setting_is_named() -> None:
    official = replace(FOUND.latencies[0], setting="official")
    rows = latency_rows(replace(FOUND, latencies=[official, FOUND.latencies[0]]))
    assert rows["name"].tolist() == ["Identity (official)", "Identity"]


def test_an_error_of_nothing_is_still_drawn() -> None:
    exact = replace(FOUND.latencies[0], error_r_deg=0.0)
    rows = latency_rows(replace(FOUND, latencies=[exact]))
    assert latency_chart(rows).data[0].y.tolist() == [1e-3]


def test_memory_is_drawn_over_points_in_ascending_order() -> None:
    (trace,) = memory_chart(pd.DataFrame(FOUND.memory[::-1])).data
    assert trace.x.tolist() == [512, 2048, 16384]
    assert trace.y.tolist() == [332.0, 428.0, 1324.0]
    assert trace.mode == "lines+markers"


def test_only_loops_have_a_distance_to_the_ceiling() -> None:
    arithmetic, traffic = benchmark_charts(FOUND)["plot-bench-ceilings"].data
    assert arithmetic.y.tolist() == ["PointNet, inference", "Sinkhorn"]
    assert arithmetic.x.tolist() == [60.0, 5.0]
    assert traffic.x.tolist() == [10.0, 75.0]
    loops = pd.DataFrame([row for row in FOUND.ceilings if row.kind == "loop"])
    order = ceilings_chart(loops).layout.yaxis.categoryarray
    assert order == ("Sinkhorn", "PointNet, inference")  # from the axis upwards


def test_nothing_measured_is_said_and_breaks_nothing(contents: Contents) -> None:
    page = render_page(contents)
    assert "<code>make bench</code> was not run here" in section(page)
    assert "plot-bench" not in page


def test_ratios_come_first_with_the_machine_they_belong_to(contents: Contents) -> None:
    text = section(render_page(replace(contents, benchmarks=FOUND)))
    assert (
        text.index(HERE) < text.index("cf train step vs plain") < text.index("plot-bench-latency")
    )
    assert '<td data-value="6.5"><strong>6.50</strong></td>' in text
    assert text.count('id="plot-bench-') == 3
    for file in ("speed", "details/latency", "details/memory", "details/ceilings"):
        assert f"benchmarks/{file}.csv" in text


def test_what_was_not_measured_has_no_place(contents: Contents) -> None:
    only = Benchmarks(ratios=FOUND.ratios)
    text = section(render_page(replace(contents, benchmarks=only)))
    assert "plot-bench" not in text
    assert "cf train step vs plain" in text


def test_the_report_reads_them_from_their_folder(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    write_benchmarks(tmp_path / "benchmarks", FOUND)
    parts = (tmp_path / name for name in ("results", "models", "pairs", "benchmarks"))
    assert HERE in section(make_report(make_the_contents(*parts, profile="quick")).page)
