"""Figures of what `make bench` measured, and the page's section about it."""

from dataclasses import replace
from pathlib import Path

import plotly.graph_objects as go
import pytest

from pipeline.formats.benchmarks import Benchmarks, write_benchmarks
from pipeline.reporting.benchmark_figures import (
    benchmark_figures,
    ceiling_figure,
    in_order,
    latency_figure,
    latency_name,
    memory_figure,
)
from pipeline.reporting.page import Contents, render_page
from pipeline.reporting.paper import METHODS
from pipeline.reporting.report import make_report
from tests.pipeline.reporting.made_up_benchmarks import HERE, make_benchmarks
from tests.pipeline.reporting.made_up_page import make_contents
from tests.pipeline.reporting.made_up_results import write_everything

FOUND = make_benchmarks()


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return replace(make_contents(tmp_path_factory.mktemp("full"), ("kitti",), 3), benchmarks=None)


def section(page: str) -> str:
    """The page's part about benchmarks."""
    start = page.index('<section id="benchmarks">')
    return page[start : page.index("</section>", start)]


@pytest.mark.parametrize("name", sorted(benchmark_figures(FOUND)))
def test_plotly_draws_them(name: str) -> None:
    go.Figure(benchmark_figures(FOUND)[name])


def test_every_method_stands_at_its_latency_and_error() -> None:
    figure = latency_figure(FOUND.latencies)
    assert figure["layout"]["xaxis"]["type"] == "log"
    drawn = {trace["customdata"][0]: (trace["x"][0], trace["y"][0]) for trace in figure["data"]}
    assert drawn.keys() == METHODS.keys()
    assert drawn["icp"] == (2.0 * 1.5**3, 2.5)


def test_a_part_of_the_points_is_named_and_hollow() -> None:
    (part,) = [each for each in FOUND.latencies if each.points == 512]
    assert latency_name(part, 2048) == "PCRDiffusion CF, first 512 points"
    (trace,) = [t for t in latency_figure(FOUND.latencies)["data"] if "first" in t["name"]]
    assert trace["marker"]["symbol"].endswith("-open")
    assert [row.points for row in in_order(FOUND.latencies) if row.method == part.method] == [
        2048,
        512,
    ]


def test_an_error_of_nothing_is_still_drawn() -> None:
    exact = replace(FOUND.latencies[0], error_r_deg=0.0)
    assert latency_figure([exact])["data"][0]["y"] == [1e-3]


def test_memory_is_drawn_over_points_in_ascending_order() -> None:
    (trace,) = memory_figure(FOUND.memory[::-1])["data"]
    assert trace["x"] == [512, 2048, 16384]
    assert trace["y"] == [332.0, 428.0, 1324.0]


def test_only_loops_have_a_distance_to_the_ceiling() -> None:
    arithmetic, traffic = ceiling_figure(FOUND.ceilings)["data"]
    assert arithmetic["y"] == ["PointNet, inference", "Sinkhorn"]
    assert arithmetic["x"] == [60.0, 5.0]
    assert traffic["x"] == [10.0, 75.0]


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
    assert HERE in section(make_report(*parts, profile="quick").page)
