"""Figures: what is drawn, and that plotly would draw it."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from pipeline.formats.walks import Walk
from pipeline.reporting.background import Training, read_pair_files, read_trainings
from pipeline.reporting.figures import (
    CYCLE,
    Figure,
    axis_start,
    cumulative,
    curve_points,
    curves_figure,
    distribution_figure,
    errors_figure,
    method_color,
    method_style,
)
from pipeline.reporting.overlays import (
    Overlay,
    choose_pairs,
    describe,
    make_overlays,
    pick_walked_pairs,
    thin,
)
from pipeline.reporting.paper import METHODS
from pipeline.reporting.result_files import Scores, headlines, read_results
from pipeline.reporting.scenes import errors, overlay_figure, scene_data, walk_figure
from pipeline.reporting.study_figures import (
    MEASURES,
    ablated_name,
    ablation_figure,
    ablation_rows,
    difficulty_figure,
    speed_figure,
    steps_figure,
)
from pipeline.reporting.tables import Row, make_rows
from pipeline.reporting.views import main_rows
from tests.pipeline.reporting.made_up_page import row, study_rows
from tests.pipeline.reporting.made_up_results import write_everything

SCENARIOS = ("modelnet40-unseen_objects", "3dmatch")
Inputs = tuple[list[Row], list[Overlay], list[Training], list[Scores]]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Inputs:
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, SCENARIOS, 6)
    scores = read_results(folder / "results")
    overlays = make_overlays(scores, read_pair_files(folder / "pairs", SCENARIOS))
    return make_rows(scores, seed=0), overlays, read_trainings(folder / "models"), scores


def test_plotly_knows_every_property(inputs: Inputs) -> None:
    rows, overlays, trainings, scores = inputs
    studies = study_rows()
    figures: list[Figure | None] = [
        *(errors_figure(rows, s, "error_r_deg", "ERROR(R) [deg]") for s in SCENARIOS),
        errors_figure(rows, SCENARIOS[1], "error_t", "ERROR(t)"),
        distribution_figure(scores, SCENARIOS[0], "unit sphere"),
        steps_figure([r for r in rows if r.table == "7"], "unit sphere"),
        steps_figure([r for r in studies if r.table == "7"], "unit sphere"),
        *(
            ablation_figure(ablation_rows(studies, table), "m")
            for table in ("3", "4", "5", "extra")
        ),
        speed_figure([r for r in studies if r.table == "6"]),
        *(difficulty_figure(studies, metric) for metric in MEASURES),
        curves_figure(trainings[:2]),
        walk_figure("m"),
        *map(overlay_figure, overlays),
    ]
    for figure in figures:
        assert figure
        assert figure["data"]
        go.Figure(figure)  # raises on a property it does not know


def test_errors_are_those_of_the_rows_and_zero_sits_at_the_edge(inputs: Inputs) -> None:
    rows = inputs[0]
    figure = errors_figure(rows, SCENARIOS[0], "error_r_deg", "ERROR(R) [deg]")
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


def rows_of_table(rows: list[Row]) -> list[Row]:
    return [*main_rows(rows, "error_r_deg").values()]


def test_panels_share_their_scale_and_their_rows(inputs: Inputs) -> None:
    one, other = (
        errors_figure(inputs[0], scenario, "error_r_deg", "E")["layout"] for scenario in SCENARIOS
    )
    for axis in ("xaxis", "yaxis"):
        assert one[axis]["range"] == other[axis]["range"]
    assert one["yaxis"]["categoryarray"] == other["yaxis"]["categoryarray"]
    assert len(one["meta"]["categories"]) == len(one["yaxis"]["categoryarray"])


def test_every_mark_says_whose_it_is_so_that_the_page_can_hide_it(inputs: Inputs) -> None:
    studies = study_rows()
    difficulty = difficulty_figure(studies, "error_r_deg")
    assert difficulty
    figures = [
        errors_figure(inputs[0], SCENARIOS[0], "error_r_deg", "E"),
        distribution_figure(inputs[3], SCENARIOS[0], "m"),
        steps_figure([r for r in studies if r.table == "7"], "m"),
        speed_figure([r for r in studies if r.table == "6"]),
        ablation_figure(ablation_rows(studies, "4"), "m"),
        difficulty,
    ]
    for trace in (trace for figure in figures for trace in figure["data"]):
        whole = trace.get("meta", {}).get("method")
        assert whole in METHODS or len(trace["customdata"]) == len(trace["x"])
        assert {*trace.get("customdata", [])} <= {*METHODS}


def test_a_distribution_ends_at_all_pairs(inputs: Inputs) -> None:
    scores = inputs[3][0]
    errors, shares = cumulative(scores, "error_r_deg")
    assert errors == sorted(errors)
    assert shares[-1] == 100
    worst = scores.numbers["error_r_deg"].max()
    assert errors[-1] == pytest.approx(max(worst, 1e-3), rel=1e-3)


def test_a_band_spans_the_draws_and_the_line_is_the_one_in_the_table() -> None:
    settings = {"steps=4,sampler=ddim": 3.0, "steps=4,sampler=ddim,draw=1": 2.0}
    settings |= {"steps=4,sampler=ddim,draw=2": 5.0, "steps=8,sampler=ddim": 4.0}
    rows = [row("7", "pcrdiffusion_cf", s, "error_r_deg", v) for s, v in settings.items()]
    low, high, line = steps_figure(rows, "m")["data"]
    assert (low["x"], low["y"], high["y"]) == ([4, 8], [2.0, 4.0], [5.0, 4.0])
    assert (line["x"], line["y"], line["name"]) == ([4, 8], [3.0, 4.0], "PCRDiffusion CF, DDIM")


def test_a_printed_bound_on_time_sits_at_the_edge_as_a_triangle() -> None:
    rows = [
        row("6", method, "paper", metric, value)
        for method in ("pcrdiffusion_cf", "icp")
        for metric, value in (("seconds", 0.02), ("error_r_deg", 3.0))
    ]
    traces = speed_figure(rows)["data"]
    hollow = {t["name"]: t for t in traces if t["marker"]["symbol"].endswith("-open")}
    assert hollow["PCRDiffusion CF"]["marker"]["symbol"] == "triangle-left-open"
    assert hollow["PCRDiffusion CF"]["x"] == [1e-3]
    assert hollow["ICP"]["x"] == [0.0042]
    assert hollow["ICP"]["y"] == [23.1548]


def test_bins_and_noise_have_a_panel_each_and_contrasts_none() -> None:
    rows = [
        row("extra", "icp", "rotation_deg=0-15", "error_r_deg", 1.0),
        row("extra", "icp", "rotation_deg=15-30", "error_r_deg", 2.0),
        row("extra", "icp", "noise=0.02", "error_r_deg", 3.0),
        row("extra", "icp", "noise=0.02 minus noise=0.01", "error_r_deg", 9.0),
    ]
    figure = difficulty_figure(rows, "error_r_deg")
    assert figure
    assert [(t["x"], t["y"]) for t in figure["data"]] == [([7.5, 22.5], [1, 2]), ([0.02], [3])]
    assert difficulty_figure(rows, "error_t") is None


def test_lines_of_an_ablation_read_as_words() -> None:
    said = {
        "diffusion=without": "PCRDiffusion CB, without diffusion",
        "representation=rotation_6d,scaling=raw": "PCRDiffusion CB, rotation 6d, raw",
        "hypotheses=1": "PCRDiffusion CB, 1 random start",
        "hypotheses=8": "PCRDiffusion CB, 8 random starts",
    }
    assert {setting: ablated_name("pcrdiffusion_cb", setting) for setting in said} == said


def test_overlays_show_the_pairs_of_best_median_and_worst_error(inputs: Inputs) -> None:
    _, overlays, _, scores = inputs
    assert [overlay.facts.scenario for overlay in overlays] == [*SCENARIOS]
    cb = headlines(scores)[SCENARIOS[0], "pcrdiffusion_cb"]
    errors = cb.numbers["error_r_deg"]
    chosen = choose_pairs(cb)
    assert {name: one.pair for name, one in overlays[0].choices.items()} == chosen
    assert [errors[pair] for pair in chosen.values()] == [np.sort(errors)[i] for i in (0, 2, 5)]
    assert overlays[0].pair == chosen["median"]
    assert overlays[0].registered[0].error_r_deg == errors[overlays[0].pair]
    for overlay in overlays[0].choices.values():
        assert [r.method for r in overlay.registered] == [
            "pcrdiffusion_cb",
            "identity",
            "constant",
            "icp_centroid",
            "icp",
            "fgr",
            "pcrdiffusion_cf",
        ]


def test_a_true_pose_lays_the_source_on_the_target(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    scores = read_results(tmp_path / "results")
    exact = [s for s in scores if s.method == "icp_centroid"]
    overlay = make_overlays(exact, read_pair_files(tmp_path / "pairs", ["kitti"]))[0]
    np.testing.assert_allclose(overlay.registered[0].points, overlay.target, atol=1e-4)
    assert not np.allclose(overlay.source, overlay.target, atol=1e-1)
    assert describe(overlay.registered[0], "m") == (
        "ICP from the centroids: rotation off by 0°, translation by 0 (m)"
    )


def test_an_overlay_draws_three_colours_and_holds_no_points(inputs: Inputs) -> None:
    traces = overlay_figure(inputs[1][0])["data"]
    assert [(trace["marker"]["color"], trace["scene"]) for trace in traces] == [
        ("#0072B2", "scene"),
        ("#E69F00", "scene"),
        ("#E69F00", "scene2"),
        ("#009E73", "scene2"),
    ]
    assert not any("x" in trace for trace in traces)


def test_poses_of_the_page_move_the_source_where_the_method_put_it(inputs: Inputs) -> None:
    overlay = inputs[1][1]
    scenes = scene_data([overlay], {}, {})
    pose = scenes["overlays"]["3dmatch"]["worst"]["poses"]["icp"]["pose"]
    worst = overlay.choices["worst"]
    source = np.array(scenes["clouds"][f"3dmatch/{worst.pair}"]["source"])
    T = np.array(pose).reshape(3, 4)
    icp = next(one for one in worst.registered if one.method == "icp")
    np.testing.assert_allclose((T[:, :3] @ source).T + T[:, 3], icp.points, atol=5e-3)


def test_a_walk_that_ends_at_the_truth_is_off_by_nothing(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    pairs = read_pair_files(tmp_path / "pairs", ["kitti"])
    truth = pick_walked_pairs({"kitti": [_walk(np.eye(4))]}, pairs)["kitti"][1].T_target_source
    walks = {"kitti": [_walk(truth)]}
    scenes = scene_data([], walks, pick_walked_pairs(walks, pairs))
    (walk,) = scenes["walks"]["kitti"]
    assert walk["predicted"][-1]["off"] == [0, 0]
    assert walk["noisy"][0]["off"][1] == pytest.approx(np.linalg.norm(truth[:3, 3]), rel=1e-2)
    assert walk["group"] == "bottle"


def _walk(end: np.ndarray) -> Walk:
    return Walk("pcrdiffusion_cb", 1, (1000, 500), np.stack([np.eye(4)] * 2), np.stack([end] * 2))


def test_the_error_of_a_pose_is_in_degrees_and_the_clouds_unit() -> None:
    quarter = np.array([[0.0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert errors(quarter[None], np.eye(4)) == [(90.0, 5.0)]


def test_a_walked_pair_must_be_there(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 1)
    pairs = read_pair_files(tmp_path / "pairs", ["kitti"])
    with pytest.raises(ValueError, match="kitti needs a test pair 1, it has 1"):
        pick_walked_pairs({"kitti": [_walk(np.eye(4))]}, pairs)


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


def test_no_two_methods_look_alike() -> None:
    looks = {
        (style["line"]["color"], style["marker"]["symbol"]) for style in map(method_style, METHODS)
    }
    assert len(looks) == len(METHODS)


def test_the_constant_pose_is_a_line_across_an_ablation(inputs: Inputs) -> None:
    rows = inputs[0]
    floors = [r for r in rows if (r.table, r.subset, r.setting) == ("1a", "all", "paper")]
    figure = ablation_figure(ablation_rows(study_rows(), "4"), "m", floors)
    values = {r.metric: r.value for r in floors if r.method == "constant"}
    drawn = {shape["xref"]: shape["x0"] for shape in figure["layout"]["shapes"]}
    assert drawn == {"x": values["error_r_deg"], "x2": values["error_t"]}
    assert not ablation_figure(ablation_rows(study_rows(), "4"), "m")["layout"]["shapes"]
