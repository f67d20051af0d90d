"""The PNG pictures: the same rows and pairs, the same bytes."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]  # ships no stubs

from pipeline.reporting.background import Training
from pipeline.reporting.canvas import plain_numbers, png
from pipeline.reporting.charts import (
    draw_ablations,
    draw_accuracy_time,
    draw_difficulty,
    draw_distributions,
    draw_steps,
)
from pipeline.reporting.difficulty import OVERLAP, ROTATION
from pipeline.reporting.figures import (
    BLUE,
    GREEN,
    GREY,
    INK,
    KINDS,
    ORANGE,
    axis_start,
    curve_points,
    method_color,
)
from pipeline.reporting.overlays import Overlay, thin
from pipeline.reporting.panels import draw_panel
from pipeline.reporting.paper import TIMING, method_rank, place, scenario_rank, shown
from pipeline.reporting.result_files import Scores
from pipeline.reporting.tables import Row
from pipeline.reporting.views import TRAINED, main_rows


def draw_all(
    rows: Sequence[Row],
    overlays: Sequence[Overlay],
    trainings: Sequence[Training],
    scores: Sequence[Scores] = (),
) -> dict[str, bytes]:
    """Draw every picture, as PNG bytes by file name; where there is nothing to draw, none."""
    main = [training for training in trainings if training.setting is None and training.curve]
    kinds = {row.setting.partition("=")[0] for row in rows if row.kind in ("line", "bin")}
    timed = any(row.table == TIMING.table for row in rows)
    candidates: list[tuple[str, object, Callable[[], bytes]]] = [
        ("errors.png", True, lambda: draw_errors(rows)),
        ("overlays.png", True, lambda: draw_overlays(overlays)),
        ("curves.png", main, lambda: draw_curves(main)),
        ("distributions.png", scores, lambda: draw_distributions(scores)),
        ("accuracy_time.png", timed, lambda: draw_accuracy_time(rows)),
        ("difficulty.png", kinds & {ROTATION, OVERLAP, "noise"}, lambda: draw_difficulty(rows)),
        ("steps.png", kinds & {"steps"}, lambda: draw_steps(rows)),
        ("ablations.png", kinds & {*TRAINED}, lambda: draw_ablations(rows)),
    ]
    pictures = {name: draw() for name, needed, draw in candidates if needed}
    panels = {one.facts.scenario.partition("-")[0]: one for one in overlays}
    return pictures | {f"panels_{name}.png": draw_panel(one) for name, one in panels.items()}


def draw_errors(rows: Sequence[Row]) -> bytes:
    """Draw methods against ERROR(R), a panel for each scenario."""
    chosen = main_rows(rows, "error_r_deg")
    scenarios = sorted({scenario for scenario, _ in chosen}, key=scenario_rank)
    methods = sorted({method for _, method in chosen}, key=method_rank)
    columns = min(3, len(scenarios))
    panels = -(-len(scenarios) // columns)
    figure = Figure(
        figsize=(3.4 * columns + 1.6, panels * (0.24 * len(methods) + 0.9)), layout="constrained"
    )
    axes = figure.subplots(panels, columns, sharex=True, sharey=True, squeeze=False)
    for ax in axes.flat[len(scenarios) :]:
        ax.set_visible(False)
    for ax, scenario in zip(axes.flat, scenarios, strict=False):
        here = [chosen[scenario, m] for m in methods if (scenario, m) in chosen]
        _draw_panel(ax, here, methods, axis_start(chosen.values(), "error_r_deg"))
        ax.set_title(place(scenario).title, fontsize=9, loc="left", fontweight="bold")
    axes[0, 0].set_xscale("log")
    plain_numbers(axes[0, 0], "x")
    figure.supxlabel("ERROR(R) [deg]: filled ours with 95 % interval, open the paper's", fontsize=9)
    return png(figure)


def _draw_panel(ax: Axes, rows: Sequence[Row], methods: Sequence[str], start: float) -> None:
    for row in rows:
        y, x = methods.index(row.method), max(row.value, start)
        color = KINDS[shown(row.method).kind]
        ax.plot([max(row.low, start), max(row.high, start)], [y, y], color=color, lw=1.5)
        ax.plot([x], [y], "<" if row.value < start else "o", color=color, ms=6)
        if row.paper is not None:
            ax.plot([row.paper], [y], "D", color=INK, mfc="none", ms=5)
        if row.method == "constant":
            ax.axvline(x, color=GREY, lw=0.8, ls=":")
    ax.set_yticks(range(len(methods)), [shown(method).name for method in methods], fontsize=8)
    ax.set_ylim(len(methods) - 0.4, -0.6)
    ax.tick_params(axis="x", labelsize=8, labelbottom=True)
    ax.grid(axis="x", color="#E4E8EC", lw=0.8)
    ax.set_axisbelow(True)


def draw_overlays(overlays: Sequence[Overlay]) -> bytes:
    """Draw each data set's pair before (upper) and after (lower)."""
    figure = Figure(figsize=(3.6 * len(overlays), 6.4), layout="constrained")
    for column, overlay in enumerate(overlays):
        best = overlay.registered[0]
        views = (
            (
                f"{overlay.title}\nsource and target",
                ((overlay.target, ORANGE), (overlay.source, BLUE)),
            ),
            (
                f"{shown(best.method).name}: {best.error_r_deg:.3g}° off",
                ((overlay.target, ORANGE), (best.points, GREEN)),
            ),
        )
        for row, (title, clouds) in enumerate(views):
            ax = figure.add_subplot(
                2, len(overlays), 1 + column + row * len(overlays), projection="3d"
            )
            _draw_clouds(ax, clouds)
            ax.set_title(title, fontsize=9)
    figure.supxlabel(
        "blue: source, orange: target, green: source registered; the pair of median error",
        fontsize=9,
    )
    return png(figure)


def _draw_clouds(ax: Axes3D, clouds: Sequence[tuple[Float64[np.ndarray, "points 3"], str]]) -> None:
    for points, color in clouds:
        few = thin(points, 900)
        ax.scatter(few[:, 0], few[:, 1], few[:, 2], s=3, c=color, linewidths=0, depthshade=False)
    extent = np.ptp(np.concatenate([cloud for cloud, _ in clouds]), axis=0)
    ax.set_box_aspect(extent, zoom=1.35)
    ax.view_init(elev=28, azim=45)
    ax.set_axis_off()


def draw_curves(trainings: Sequence[Training]) -> bytes:
    """Draw the validation error of every training, a panel for each scenario."""
    scenarios = sorted({one.scenario for one in trainings if one.curve}, key=scenario_rank)
    columns = min(3, len(scenarios))
    panels = -(-len(scenarios) // columns)
    figure = Figure(figsize=(3.6 * columns + 0.4, 2.3 * panels + 0.6), layout="constrained")
    axes = figure.subplots(panels, columns, squeeze=False)
    for ax in axes.flat[len(scenarios) :]:
        ax.set_visible(False)
    for ax, scenario in zip(axes.flat, scenarios, strict=False):
        for one in (one for one in trainings if one.scenario == scenario and one.curve):
            points = curve_points(one.curve, "val_error_r_deg")
            color, name = method_color(one.method), shown(one.method).name
            mark = "." if len(points[0]) <= 6 else None  # one look at the validation is a dot
            ax.plot(*points, color=color, lw=1.4, marker=mark, label=name)
        ax.set_yscale("log")
        plain_numbers(ax, "y")
        ax.set_title(place(scenario).title, fontsize=9, loc="left", fontweight="bold")
        ax.tick_params(labelsize=8)
        ax.legend(fontsize=7, frameon=False)
        ax.grid(color="#E4E8EC", lw=0.8)
    figure.supxlabel("training step", fontsize=9)
    figure.supylabel("validation ERROR(R) [deg]", fontsize=9)
    return png(figure)
