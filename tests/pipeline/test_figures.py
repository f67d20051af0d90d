"""Figures: what is drawn, and that plotly would draw it."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from pipeline.background import Training, read_trainings
from pipeline.figures import (
    CYCLE,
    Figure,
    axis_start,
    curve_points,
    curves_figure,
    errors_figure,
    method_color,
    overlay_figure,
    steps_figure,
)
from pipeline.overlays import Overlay, describe, median_pair, read_overlays, thin
from pipeline.paper import METHODS
from pipeline.pictures import draw_all
from pipeline.result_files import Scores, read_results
from pipeline.tables import Row, make_rows
from tests.pipeline.made_up_results import plain_row, write_everything, write_rows

SCENARIOS = ("modelnet40-unseen_objects", "3dmatch")
Inputs = tuple[list[Row], list[Overlay], list[Training], list[Scores]]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, SCENARIOS, 6)
    scores = read_results(folder / "results")
    overlays = read_overlays(scores, folder / "pairs")
    return make_rows(scores, seed=0), overlays, read_trainings(folder / "models"), scores


def test_plotly_knows_every_property(inputs: Inputs) -> None:
    rows, overlays, trainings, _ = inputs
    figures: list[Figure] = [
        errors_figure(rows, "error_r_deg", "ERROR(R) [deg]"),
        errors_figure(rows, "error_t", "ERROR(t)"),
        steps_figure([row for row in rows if row.table == "7"], "unit sphere"),
        curves_figure(trainings[:2]),
        *map(overlay_figure, overlays),
    ]
    for figure in figures:
        go.Figure(figure)  # raises on a property it does not know


def test_errors_are_those_of_the_rows_and_zero_sits_at_the_edge(inputs: Inputs) -> None:
    rows = inputs[0]
    figure = errors_figure(rows, "error_r_deg", "ERROR(R) [deg]")
    floors = next(trace for trace in figure["data"] if trace["name"] == "floor")
    drawn = dict(zip(floors["y"], floors["x"], strict=True))
    (identity,) = [
        r
        for r in rows
        if (r.method, r.table, r.metric, r.subset) == ("identity", "1a", "error_r_deg", "all")
    ]
    assert drawn["Identity"] == identity.value
    assert drawn["ICP from the centroids"] == axis_start(rows_of_table(rows), "error_r_deg")
    assert (
        floors["marker"]["symbol"][floors["y"].index("ICP from the centroids")] == "triangle-left"
    )
    assert {f"xaxis{suffix}" for suffix in ("", "2")} <= {*figure["layout"]}


def rows_of_table(rows: list[Row]) -> list[Row]:
    return [r for r in rows if (r.subset, r.metric) == ("all", "error_r_deg") and r.table != "7"]


def test_a_panel_never_leaves_the_picture(tmp_path: Path) -> None:
    for number in range(10):
        write_rows(tmp_path / f"scenario{number}" / "icp.csv", [plain_row(0, off_deg=1.0)])
    layout = errors_figure(make_rows(read_results(tmp_path), seed=0), "error_r_deg", "E")["layout"]
    domains = [value["domain"] for name, value in layout.items() if "axis" in name]
    assert len(domains) == 20
    assert all(0 <= low < high <= 1 for low, high in domains)


def test_the_overlay_shows_the_pair_of_median_error(inputs: Inputs) -> None:
    _, overlays, _, scores = inputs
    assert [overlay.facts.scenario for overlay in overlays] == [*SCENARIOS]
    cb = next(s for s in scores if (s.scenario, s.method) == (SCENARIOS[0], "pcrdiffusion_cb"))
    errors = cb.numbers["error_r_deg"]
    assert overlays[0].pair == median_pair(cb)
    assert np.sort(errors)[2] == errors[overlays[0].pair] == overlays[0].registered[0].error_r_deg
    assert [r.method for r in overlays[0].registered] == [
        "pcrdiffusion_cb",
        "pcrdiffusion_cf",
        "icp",
    ]


def test_a_true_pose_lays_the_source_on_the_target(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    scores = read_results(tmp_path / "results")
    exact = [s for s in scores if s.method == "icp_centroid"]
    overlay = read_overlays(exact, tmp_path / "pairs")[0]
    np.testing.assert_allclose(overlay.registered[0].points, overlay.target, atol=1e-4)
    assert not np.allclose(overlay.source, overlay.target, atol=1e-1)
    assert describe(overlay.registered[0], "m") == (
        "ICP from the centroids: rotation off by 0°, translation by 0 (m)"
    )


def test_an_overlay_draws_three_colours_and_one_registration_at_a_time(inputs: Inputs) -> None:
    traces = overlay_figure(inputs[1][0])["data"]
    assert [trace["marker"]["color"] for trace in traces[:4]] == [
        "#0072B2",
        "#E69F00",
        "#E69F00",
        "#009E73",
    ]
    assert [trace["visible"] for trace in traces[3:]] == [True, False, False]


def test_thinning_keeps_few_points_from_first_to_last() -> None:
    points = np.arange(30000.0).reshape(-1, 3)
    few = thin(points, 100)
    assert len(few) == 100
    assert few[0, 0] == 0
    assert few[-1, -1] == 29999
    assert len(thin(points[:7], 100)) == 7


def test_curves_leave_gaps_out(inputs: Inputs) -> None:
    curve = inputs[2][0].curve
    assert len(curve_points(curve, "loss")[0]) == 30
    assert curve_points(curve, "val_error_r_deg")[0] == [float(38 * e) for e in range(2, 31, 2)]
    assert curve_points(curve, "no_such_column") == ([], [])
    assert (
        len(curve_points({"step": [*map(float, range(2000))], "loss": [1.0] * 2000}, "loss")[0])
        == 500
    )


def test_learned_methods_have_colours_of_their_own() -> None:
    learned = [name for name, entry in METHODS.items() if entry.kind == "learned"]
    assert len({method_color(name) for name in learned}) == len(learned)
    assert method_color("a_method_of_next_year") in CYCLE


def test_pictures_are_png_and_the_same_twice(inputs: Inputs) -> None:
    rows, overlays, trainings, _ = inputs
    pictures = draw_all(rows, overlays, trainings)
    assert sorted(pictures) == ["curves.png", "errors.png", "overlays.png"]
    assert all(content.startswith(b"\x89PNG") for content in pictures.values())
    assert pictures == draw_all(rows, overlays, trainings)
    assert all(len(content) < 400_000 for content in pictures.values())


def test_no_curves_no_picture_of_them(inputs: Inputs) -> None:
    assert "curves.png" not in draw_all(inputs[0], inputs[1], [])
