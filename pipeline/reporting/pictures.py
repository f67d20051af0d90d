"""The PNG pictures: the same rows and pairs, the same bytes."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes

from pipeline.reporting.background import Training
from pipeline.reporting.canvas import COLUMNS, dress, grid_of_panels, plain_numbers, png
from pipeline.reporting.charts import (
    draw_ablations,
    draw_accuracy_time,
    draw_difficulty,
    draw_distributions,
    draw_steps,
)
from pipeline.reporting.difficulty import OVERLAP, ROTATION
from pipeline.reporting.figures import (
    GREY,
    INK,
    KINDS,
    axis_start,
    curve_points,
    method_color,
)
from pipeline.reporting.overlays import Overlay
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
    start = axis_start(chosen.values(), "error_r_deg")
    figure, axes = grid_of_panels(len(scenarios), 0.24 * len(methods) + 0.9, labels=0.1, left=1.6)
    for index, (ax, scenario) in enumerate(zip(axes, scenarios, strict=True)):
        if index:
            ax.sharex(axes[0])
            ax.sharey(axes[0])
        here = [chosen[scenario, m] for m in methods if (scenario, m) in chosen]
        _draw_panel(ax, here, methods, start)
        dress(ax, place(scenario).title, "ERROR(R) [deg], 95 % interval; open: the paper's", "")
        ax.tick_params(labelleft=index % COLUMNS == 0)
    axes[0].set_xscale("log")
    plain_numbers(axes[0], "x")
    return png(figure)


def _draw_panel(ax: Axes, rows: Sequence[Row], methods: Sequence[str], start: float) -> None:
    y = np.array([methods.index(row.method) for row in rows])
    low, x, high, paper = (
        np.array([np.nan if (number := getattr(row, name)) is None else number for row in rows])
        for name in ("low", "value", "high", "paper")
    )
    colors = [KINDS[shown(row.method).kind] for row in rows]
    ax.hlines(y, low.clip(start), high.clip(start), colors=colors, lw=1.5)
    for mark, some in (("<", x < start), ("o", x >= start)):
        ax.scatter(x[some].clip(start), y[some], s=36, c=np.array(colors)[some], marker=mark)
    ax.scatter(paper, y, s=25, c="none", marker="D", edgecolors=INK)
    for row in rows:
        if row.method == "constant":
            ax.axvline(max(row.value, start), color=GREY, lw=0.8, ls=":")
    ax.set_yticks(range(len(methods)), [shown(method).name for method in methods])
    ax.set_ylim(len(methods) - 0.4, -0.6)


def draw_curves(trainings: Sequence[Training]) -> bytes:
    """Draw the validation error of every training, a panel for each scenario."""
    scenarios = sorted({one.scenario for one in trainings if one.curve}, key=scenario_rank)
    figure, axes = grid_of_panels(len(scenarios), 2.6)
    for ax, scenario in zip(axes, scenarios, strict=True):
        for one in (one for one in trainings if one.scenario == scenario and one.curve):
            points = curve_points(one.curve, "val_error_r_deg")
            color, name = method_color(one.method), shown(one.method).name
            mark = "." if len(points[0]) <= 6 else None  # one look at the validation is a dot
            ax.plot(*points, color=color, lw=1.4, marker=mark, label=name)
        ax.set_yscale("log")
        plain_numbers(ax, "y")
        ax.legend(fontsize=7, frameon=False, loc="upper right")
        dress(ax, place(scenario).title, "training step", "validation ERROR(R) [deg]")
    return png(figure)
