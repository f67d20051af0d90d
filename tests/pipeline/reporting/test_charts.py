"""Charts: what is drawn, and whose each mark is."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from plotly import graph_objects as go

from pipeline.reporting.charts import (
    MEASURES,
    ablated_name,
    ablation_chart,
    cumulative,
    curve_points,
    curves_chart,
    difficulty_chart,
    distribution_chart,
    errors_chart,
    headlines,
    reliability_chart,
    speed_chart,
    steps_chart,
)
from pipeline.reporting.drawing import CYCLE, axis_start, method_style, thinned
from pipeline.reporting.page import ABLATED, Contents, make_charts
from pipeline.reporting.paper import METHODS, shown
from pipeline.reporting.reading import choose
from pipeline.reporting.report import make_contents as make_the_contents
from tests.pipeline.reporting.synthetic_page import make_contents
from tests.pipeline.reporting.synthetic_results import write_everything
from tests.pipeline.reporting.test_numbers import pick

UNSEEN = "modelnet40-unseen_objects"
SCENARIOS = (UNSEEN, "modelnet40-partial", "3dmatch")


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return make_contents(tmp_path_factory.mktemp("synthetic"), SCENARIOS, 12)


@pytest.fixture(scope="module")
def numbers(contents: Contents) -> pd.DataFrame:
    return contents.numbers


def traces(figure: go.Figure, method: str, **wanted: object) -> list[go.Scatter]:
    """The traces of a method that are so."""
    return [
        trace
        for trace in figure.data
        if trace.meta == method and all(trace[name] == value for name, value in wanted.items())
    ]


def test_there_is_a_chart_of_everything_there_is_data_for(contents: Contents) -> None:
    expected = {"plot-steps", "plot-speed", "plot-bench-latency", "plot-bench-memory"}
    expected |= {"plot-bench-ceilings", *(f"plot-ablation-{name}" for name in ABLATED)}
    expected |= {f"plot-difficulty-{metric}" for metric in MEASURES}
    expected |= {f"plot-starts-{name}" for name in SCENARIOS[:2]}
    kinds = ("error_r_deg", "error_t", "distribution", "reliability", "curves")
    expected |= {f"plot-{kind}-{name}" for kind in kinds for name in SCENARIOS}
    charts = make_charts(contents)
    assert {*charts} == expected
    assert all(len(chart.data) for chart in charts.values())


def test_every_mark_says_whose_it_is_so_that_the_page_can_hide_it(contents: Contents) -> None:
    for name, chart in make_charts(contents).items():
        if name != "plot-bench-ceilings":  # of loops, not of methods
            assert {trace.meta for trace in chart.data} <= {*METHODS}


def test_a_legend_names_nothing_twice(contents: Contents) -> None:
    for chart in make_charts(contents).values():
        named = [trace.name for trace in chart.data if trace.showlegend]
        assert len({*named}) == len(named) > 0


def test_errors_are_those_of_the_numbers_and_zero_sits_at_the_edge(numbers: pd.DataFrame) -> None:
    figure = errors_chart(numbers, UNSEEN, "error_r_deg", "unit sphere")
    identity = pick(numbers, method="identity", table="1a", metric="error_r_deg", subset="all")
    (drawn,) = traces(figure, "identity")
    assert ([*drawn.x], [*drawn.y]) == ([identity["value"]], ["Identity"])
    assert drawn.error_x.array[0] == pytest.approx(identity["high"] - identity["value"])
    (exact,) = traces(figure, "icp_centroid")
    start = axis_start(headlines(numbers, "error_r_deg"), "error_r_deg")
    assert ([*exact.x], exact.marker.symbol) == ([start], "triangle-left")
    (paper,) = traces(figure, "fgr", name="printed in the paper")
    assert ([*paper.x], [*paper.y]) == ([4.3337], ["FGR"])


def test_panels_share_their_scale_and_their_lines(numbers: pd.DataFrame) -> None:
    one, other = (errors_chart(numbers, name, "error_r_deg", "m").layout for name in SCENARIOS[:2])
    assert one.xaxis.range == other.xaxis.range
    assert one.yaxis.categoryarray == other.yaxis.categoryarray
    assert one.yaxis.range == other.yaxis.range
    assert one.yaxis.categoryarray[::-1] == tuple(entry.name for entry in METHODS.values())


def test_the_constant_pose_is_a_line_across(numbers: pd.DataFrame) -> None:
    value = pick(numbers, table="1a", method="constant", metric="error_r_deg", subset="all")[
        "value"
    ]
    (line,) = errors_chart(numbers, UNSEEN, "error_r_deg", "m").layout.shapes
    assert (line.x0, line.x1) == (value, value)
    ablation = ablation_chart(numbers, "representation", "m").layout.shapes
    assert [line.xref for line in ablation] == ["x", "x2"]
    assert ablation[0].x0 == value
    without = numbers[numbers["method"] != "constant"]
    assert not ablation_chart(without, "representation", "m").layout.shapes


def test_an_ablation_stands_in_the_order_of_the_paper(numbers: pd.DataFrame) -> None:
    figure = ablation_chart(numbers, "representation", "m")
    assert figure.layout.yaxis.categoryarray[::-1][:2] == (
        "PCRDiffusion CB, euler, raw",
        "PCRDiffusion CB, quaternion, raw",
    )  # what the paper prints
    assert len(figure.layout.yaxis.categoryarray) == 12
    paper = traces(figure, "pcrdiffusion_cb", name="printed in the paper")
    assert sorted(paper[0].x) == [1.2732, 13.7542]


def test_lines_of_an_ablation_read_as_words() -> None:
    said = {
        "diffusion=without": "PCRDiffusion CB, without diffusion",
        "representation=rotation_6d,scaling=raw": "PCRDiffusion CB, rotation 6d, raw",
        "hypotheses=1": "PCRDiffusion CB, 1 random start",
        "hypotheses=8": "PCRDiffusion CB, 8 random starts",
    }
    assert {setting: ablated_name("pcrdiffusion_cb", setting) for setting in said} == said


def test_a_line_is_the_one_in_the_table_and_strokes_are_further_draws(
    numbers: pd.DataFrame,
) -> None:
    named = {"table": "7", "method": "pcrdiffusion_cf", "metric": "error_r_deg", "subset": "all"}
    rows = choose(numbers, **named, sampler="ddim")
    figure = steps_chart(numbers, "m")
    line, strokes = traces(figure, "pcrdiffusion_cf", name="PCRDiffusion CF, DDIM", yaxis="y")
    first = choose(rows, kind="line").set_index("steps")["value"]
    assert dict(zip(line.x, line.y, strict=True)) == {int(k): v for k, v in first.items()}
    assert line.x.tolist() == [1, 2, 4, 8, 16]
    assert (line.mode, strokes.mode, strokes.marker.symbol) == (
        "lines+markers", "markers", "line-ew-open"
    )  # fmt: skip
    assert sorted(strokes.y) == sorted(choose(rows, kind="draw")["value"])
    assert figure.layout.xaxis.tickvals == (1, 2, 4, 8, 16)
    (paper,) = traces(figure, "pcrdiffusion_cf", name="printed in the paper", yaxis="y")
    assert paper.y.tolist() == [3.2786, 3.1962, 3.1962, 3.1962]


def test_a_printed_bound_on_time_sits_at_the_edge_as_a_triangle(numbers: pd.DataFrame) -> None:
    figure = speed_chart(numbers)
    ours, bound = traces(figure, "pcrdiffusion_cf", xaxis="x")
    assert bound.marker.symbol == "triangle-left-open"
    seconds = choose(numbers, metric="seconds", kind="line")["value"]
    assert seconds.min() / 100 < bound.x[0] < seconds.min()
    assert "below 1e-10 s" in bound.hovertext[0]
    assert not bound.showlegend
    icp = traces(figure, "icp", xaxis="x")[1]
    assert ([*icp.x], [*icp.y], icp.marker.symbol[-5:]) == ([0.0042], [23.1548], "-open")
    assert len(traces(figure, "icp", xaxis="x2")) == 1  # the paper prints no memory
    assert ours.error_y.array is not None


def test_a_cost_of_a_method_the_paper_does_not_time_is_drawn_too(numbers: pd.DataFrame) -> None:
    alone = choose(numbers, table="6", method="egst")
    assert {trace.meta for trace in speed_chart(alone).data} == {"egst"}


def test_bins_and_noise_have_a_panel_each_and_contrasts_none(numbers: pd.DataFrame) -> None:
    figure = difficulty_chart(numbers, "error_r_deg")
    assert figure
    titles = [one.text.partition(" [")[0] for one in figure.layout.annotations]
    assert titles == ["true rotation angle", "overlap", "jitter, standard deviation"]
    (line,) = traces(figure, "fgr", xaxis="x3")
    noise = choose(numbers, ablation="noise", method="fgr", metric="error_r_deg", kind="line",
                   subset="all").sort_values("written")  # fmt: skip
    assert line.y.tolist() == noise["value"].tolist()
    assert np.abs(line.x - noise["noise"].astype(float)).max() < 0.0025  # beside, within a bin
    angles = np.concatenate([trace.x for trace in figure.data if trace.xaxis == "x"])
    off = angles % 15 - 7.5  # methods share half a bin
    assert 3.5 < np.abs(off).max() < 3.75
    contrasts = choose(numbers, kind="contrast")
    assert difficulty_chart(contrasts, "error_r_deg") is None


def test_one_bin_alone_is_drawn_in_its_middle(numbers: pd.DataFrame) -> None:
    rows = choose(numbers, by="overlap", metric="error_t", method="fgr")
    figure = difficulty_chart(rows, "error_t")
    assert figure
    assert figure.data[0].x.tolist() == pytest.approx([0.95])


def test_a_distribution_ends_at_all_pairs(contents: Contents) -> None:
    figure = distribution_chart(contents.answers, UNSEEN, "m")
    fgr = contents.answers[contents.answers["headline"] & (contents.answers["method"] == "fgr")]
    errors = fgr.loc[fgr["scenario"] == UNSEEN, "error_r_deg"]
    (line,) = traces(figure, "fgr", xaxis="x")
    assert line.x.tolist() == pytest.approx(sorted(errors), rel=1e-3)
    assert line.y[-1] == 100
    (exact,) = traces(figure, "icp_centroid", xaxis="x")
    assert {*exact.x} == {1e-3}
    assert line.line.shape == "hv"


def test_a_long_distribution_is_thinned_evenly_and_keeps_its_end() -> None:
    errors = pd.DataFrame({"error": np.arange(1000.0), "method": "icp", "metric": "error_t"})
    points = cumulative(errors, most=100)
    assert len(points) == 100
    assert np.ptp(np.diff(points["y"])) <= 0.2  # evenly
    assert (points["x"].iloc[0], points["x"].iloc[-1], points["y"].iloc[-1]) == (0.00001, 999, 100)


def test_curves_leave_gaps_out(contents: Contents) -> None:
    curve = contents.trainings[0].curve
    assert len(curve_points(curve, "loss")) == 30
    steps = curve_points(curve, "val_error_r_deg")["x"]
    assert steps.tolist() == [float(38 * epoch) for epoch in range(2, 31, 2)]
    assert curve_points(curve, "no_such_column").empty
    figure = curves_chart([one for one in contents.trainings if one.scenario == UNSEEN][:2])
    assert [len(trace.x) for trace in figure.data] == [30, 30, 15, 15]


def test_thinning_keeps_few_from_first_to_last() -> None:
    assert len(thinned(2000, 500)) == 500
    assert thinned(2000, 500)[[0, -1]].tolist() == [0, 1999]
    assert thinned(3, 500).tolist() == [0, 1, 2]
    assert thinned(0, 500).tolist() == []


def test_learned_methods_have_colours_of_their_own() -> None:
    learned = [name for name, entry in METHODS.items() if entry.kind == "learned"]
    assert len({method_style(name)[0] for name in learned}) == len(learned)
    assert method_style("a_method_of_next_year")[0] in CYCLE


def test_no_two_methods_look_alike() -> None:
    assert len({method_style(method)[:2] for method in METHODS}) == len(METHODS)
    dashes = {shown(method).kind: method_style(method)[2] for method in METHODS}
    assert dashes == {"floor": "dot", "classical": "dash", "learned": "solid"}


def test_reliability_is_the_share_of_right_answers_by_their_probability() -> None:
    answers = pd.DataFrame(
        {
            "scenario": [UNSEEN] * 6 + ["kitti"],
            "ablation": "",
            "method": "gicp_multistart",
            "setting": ["official"] * 5 + ["paper", "official"],
            "probability": [0.02, 0.04, 0.97, 0.99, np.nan, 0.5, 0.6],
            "right": [False, True, True, True, True, False, True],
        }
    )
    figure = reliability_chart(answers, UNSEEN)
    drawn = {
        (trace.name, trace.xaxis): (list(trace.x), list(trace.y), list(trace.hovertext))
        for trace in figure.data
    }
    name = "GICP, random starts"
    assert [*drawn] == [
        (f"{name}, official", "x"), (name, "x"), (f"{name}, official", "x2"), (name, "x2"),
    ]  # fmt: skip
    x, y, says = drawn[f"{name}, official", "x"]
    assert x == pytest.approx([0.03, 0.98])
    assert y == [0.5, 1.0]
    assert says == [
        "2 answers of probability 0.03<br>50 % right",
        "2 answers of probability 0.98<br>100 % right",
    ]
    assert drawn[f"{name}, official", "x2"][1] == [2, 2]
    assert drawn[name, "x"][:2] == ([0.5], [0.0])
    (diagonal,) = figure.layout.shapes
    assert (diagonal.x0, diagonal.y0, diagonal.x1, diagonal.y1) == (0, 0, 1, 1)


def test_a_scenario_without_probabilities_has_no_reliability_chart(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    parts = (tmp_path / name for name in ("results", "models", "pairs", "benchmarks"))
    charts = make_charts(make_the_contents(*parts, profile="quick"))
    assert not [name for name in charts if "reliability" in name]
