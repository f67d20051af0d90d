"""Interactive figures as plain plotly dictionaries: the page draws them, nothing else does."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.background import Training
from pipeline.overlays import Cloud, Overlay, thin
from pipeline.paper import METHODS, method_rank, place, scenario_rank, shown
from pipeline.tables import Row
from pipeline.views import main_rows, natural

Figure = dict[str, Any]
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"  # Okabe and Ito
GREY, INK, GRID = "#7A7A7A", "#1D2733", "#E4E8EC"
KINDS = {"floor": GREY, "classical": ORANGE, "learned": BLUE}
CYCLE = (BLUE, RED, GREEN, "#CC79A7", ORANGE, "#56B4E9", "#000000", "#B8A800", "#882255", "#6E4B9B")
SMALLEST = {"error_r_deg": 1e-3, "error_t": 1e-5}
"""Nothing is drawn smaller than this on a logarithmic axis: it sits there, as a triangle."""
FONT = {"family": "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif", "size": 12}
COLUMNS = 3
HALVES = ([0, 0.46], [0.54, 1])


def layout(height: int, **more: object) -> Figure:
    """What all figures look like."""
    return {
        "height": height,
        "font": {**FONT, "color": INK},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "white",
        "margin": {"l": 60, "r": 16, "t": 60, "b": 50},
        "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1, "yanchor": "top", "yref": "container", "x": 0},
        **more,
    }


def axis(label: str | None, **more: object) -> Figure:
    """What all axes look like; ``label`` names the quantity and its unit."""
    return {
        "gridcolor": GRID,
        "linecolor": "#9AA5B1",
        "zeroline": False,
        "automargin": True,
        "exponentformat": "none",
        "tickfont": {"size": 11},
        "title": {"text": label, "standoff": 6},
        **more,
    }


def axis_start(rows: Iterable[Row], metric: str) -> float:
    """Find where a logarithmic axis may begin: the decade below the smallest thing drawn."""
    numbers = [x for row in rows for x in (row.value, row.low, row.paper) if x]
    smallest = min(numbers, default=1.0)
    return max(SMALLEST[metric], float(10 ** np.floor(np.log10(smallest))))


def method_color(method: str) -> str:
    """Give a learned method its colour, the same in every figure."""
    learned = [name for name, entry in METHODS.items() if entry.kind == "learned"][::-1]
    index = learned.index(method) if method in learned else len(learned) + len(method)
    return CYCLE[index % len(CYCLE)]


def errors_figure(rows: Sequence[Row], metric: str, label: str) -> Figure:
    """Draw methods against error, a panel for each scenario, on one logarithmic scale."""
    chosen = main_rows(rows, metric)
    scenarios = sorted({scenario for scenario, _ in chosen}, key=scenario_rank)
    methods = sorted({method for _, method in chosen}, key=method_rank)
    names = [shown(method).name for method in reversed(methods)]
    panels = -(-len(scenarios) // COLUMNS)
    height = panels * (24 * len(methods) + 90) + 60
    start = axis_start(chosen.values(), metric)
    top = max([10 * start, *(x for row in chosen.values() for x in (row.high, row.paper or 0))])
    extent = [float(np.log10(start / 1.6)), float(np.log10(top * 1.6))]
    figure: Figure = {"data": [], "layout": layout(height, annotations=[], shapes=[])}
    for index, scenario in enumerate(scenarios):
        x, y, box = *_axis_names(index), _box(index, panels, 86 / height)
        here = [chosen[scenario, method] for method in methods if (scenario, method) in chosen]
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            label, type="log", range=extent, domain=box[0], anchor=y, dtick=1
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(
            None,
            type="category",
            categoryorder="array",
            categoryarray=names,
            range=[-0.6, len(names) - 0.4],
            domain=box[1],
            anchor=x,
            showticklabels=index % COLUMNS == 0,
        )
        figure["layout"]["annotations"].append(_heading(place(scenario).title, box))
        figure["layout"]["shapes"] += _constant_line(here, start, (x, y))
        for trace in _error_traces(here, start):
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
    return figure


def _axis_names(index: int) -> tuple[str, str]:
    suffix = str(index + 1) if index else ""
    return f"x{suffix}", f"y{suffix}"


def _box(index: int, panels: int, gap: float) -> tuple[list[float], list[float]]:
    """Place a panel: its horizontal and vertical domain, ``gap`` of the height between rows."""
    row, column = divmod(index, COLUMNS)
    tall = (1 - (panels - 1) * gap) / panels
    top = 1 - row * (tall + gap)
    x = [column / COLUMNS + 0.012, (column + 1) / COLUMNS - 0.012]
    return [round(at, 4) for at in x], [round(max(0.0, top - tall), 4), round(top, 4)]


def _heading(text: str, box: tuple[list[float], list[float]]) -> Figure:
    where = {"xref": "paper", "xanchor": "left", "yref": "paper", "yanchor": "bottom"}
    text = f"<b>{text}</b>"
    return {"text": text, "showarrow": False, "x": box[0][0], "y": box[1][1], **where}


def _error_traces(rows: Sequence[Row], start: float) -> list[Figure]:
    traces = []
    for kind, color in KINDS.items():
        ours = [row for row in rows if shown(row.method).kind == kind]
        symbols = ["triangle-left" if row.value < start else "circle" for row in ours]
        values = [max(row.value, start) for row in ours]
        traces.append(
            {
                **_marks(kind, ours, values, vertical=False),
                "marker": {"color": color, "size": 9, "symbol": symbols},
                "error_x": _interval(ours, values, start, color),
            }
        )
    theirs = [row for row in rows if row.paper is not None]
    marker = {"color": INK, "size": 9, "symbol": "diamond-open", "line": {"width": 1.5}}
    printed = _marks("printed in the paper", theirs, [r.paper for r in theirs], vertical=False)
    return [*traces, {**printed, "marker": marker}]


def _marks(name: str, rows: Sequence[Row], values: Sequence[Any], *, vertical: bool) -> Figure:
    """Put values on one axis; on the other, methods by name or, vertically, sampling steps."""
    along = [_steps(row) if vertical else shown(row.method).name for row in rows]
    return {
        "type": "scatter",
        "mode": "lines+markers" if vertical else "markers",
        "name": name,
        "legendgroup": name,
        "x": along if vertical else values,
        "y": values if vertical else along,
        "text": [_hover(row) for row in rows],
        "hoverinfo": "text",
    }


def _interval(rows: Sequence[Row], values: Sequence[float], start: float, color: str) -> Figure:
    pairs = list(zip(rows, values, strict=True))
    return {
        "type": "data",
        "symmetric": False,
        "color": color,
        "thickness": 1.5,
        "width": 3,
        "array": [max(row.high - value, 0) for row, value in pairs],
        "arrayminus": [max(value - max(row.low, start), 0) for row, value in pairs],
    }


def _constant_line(rows: Sequence[Row], start: float, axes: tuple[str, str]) -> list[Figure]:
    at = [max(row.value, start) for row in rows if row.method == "constant"]
    where = {"xref": axes[0], "yref": f"{axes[1]} domain", "y0": 0, "y1": 1, "layer": "below"}
    line = {"color": GREY, "width": 1, "dash": "dot"}
    return [{"type": "line", "x0": x, "x1": x, "line": line, **where} for x in at]


def _hover(row: Row) -> str:
    paper = "" if row.paper is None else f"<br>paper: {row.paper}"
    return (
        f"<b>{shown(row.method).name}</b> ({row.setting})<br>{row.value:g}"
        f" [{row.low:g}, {row.high:g}]{paper}<br>{row.pairs} pairs, {row.failures} failures"
    )


def steps_figure(rows: Sequence[Row], unit: str) -> Figure:
    """Draw error against sampling steps: rotation at the left, translation at the right.

    Args:
        rows: Those of Table 7, of one scenario.
        unit: Its unit of length.
    """
    figure: Figure = {"data": [], "layout": layout(340)}
    labels = {"error_r_deg": "ERROR(R) [deg]", "error_t": f"ERROR(t) [{unit}]"}
    chosen = [row for row in rows if row.subset == "all"]
    ticks = sorted({_steps(row) for row in chosen})
    for index, (metric, label) in enumerate(labels.items()):
        x, y = _axis_names(index)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            "sampling steps", type="log", tickvals=ticks, domain=HALVES[index], anchor=y
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(label, rangemode="tozero", anchor=x)
        for method in sorted({row.method for row in chosen}, key=method_rank):
            here = [row for row in chosen if (row.method, row.metric) == (method, metric)]
            for trace in _step_traces(sorted(here, key=lambda row: natural(row.setting))):
                figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
    return figure


def _steps(row: Row) -> int:
    return int(row.setting.partition("=")[2])


def _step_traces(rows: Sequence[Row]) -> list[Figure]:
    name, color = shown(rows[0].method).name, method_color(rows[0].method)
    values = [row.value for row in rows]
    theirs = [row for row in rows if row.paper is not None]
    ours = {
        **_marks(name, rows, values, vertical=True),
        "line": {"color": color},
        "error_y": _interval(rows, values, 0.0, color),
    }
    printed = {
        **_marks(f"{name}, printed in the paper", theirs, [r.paper for r in theirs], vertical=True),
        "line": {"color": INK, "dash": "dash", "width": 1.5},
        "marker": {"symbol": "diamond-open", "size": 9},
    }
    return [ours, printed] if theirs else [ours]


def curves_figure(trainings: Sequence[Training]) -> Figure:
    """Draw the trainings of one scenario: loss at the left, validation error at the right."""
    figure: Figure = {"data": [], "layout": layout(360)}
    panels = {"loss": "training loss", "val_error_r_deg": "validation ERROR(R) [deg]"}
    for index, (column, label) in enumerate(panels.items()):
        x, y = _axis_names(index)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            "training step", domain=HALVES[index], anchor=y, rangemode="tozero"
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(
            label, type="log", dtick="D2", minorloglabels="complete", anchor=x
        )
        for training in trainings:
            steps, values = curve_points(training.curve, column)
            trace = {
                "type": "scatter",
                "mode": "lines" if len(steps) > 60 else "lines+markers",
                "name": shown(training.method).name,
                "legendgroup": training.method,
                "x": steps,
                "y": values,
                "line": {"color": method_color(training.method), "width": 1.8},
                "marker": {"size": 5},
                "hovertemplate": "step %{x}: %{y:.4g}",
            }
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
    return figure


def curve_points(
    curve: Mapping[str, Sequence[float | None]], column: str, most: int = 500
) -> tuple[list[float], list[float]]:
    """Pair a column with its training steps, leaving gaps out and thinning long curves."""
    steps = curve.get("step", [])
    points = [
        (step, value)
        for step, value in zip(steps, curve.get(column, [None] * len(steps)), strict=True)
        if step is not None and value is not None
    ]
    kept = np.unique(np.linspace(0, len(points) - 1, min(most, len(points))).astype(int))
    return [points[i][0] for i in kept], [float(f"{points[i][1]:.5g}") for i in kept]


def overlay_figure(overlay: Overlay) -> Figure:
    """Draw a pair before (source, target) and after (target, source as each method put it)."""
    axes = {f"{name}axis": _space_axis(f"{name} [{overlay.facts.unit}]") for name in "xyz"}
    camera = {"eye": {"x": 1.3, "y": 1.3, "z": 0.85}, "center": {"x": 0, "y": 0, "z": -0.12}}
    scene = {**axes, "aspectmode": "data", "camera": camera, "dragmode": "orbit"}
    after = [
        {**_cloud(f"source registered by {shown(one.method).name}", one.points, GREEN, "scene2")}
        | {"visible": index == 0}
        for index, one in enumerate(overlay.registered)
    ]
    return {
        "data": [
            _cloud("source", overlay.source, BLUE, "scene"),
            _cloud("target", overlay.target, ORANGE, "scene"),
            {**_cloud("target", overlay.target, ORANGE, "scene2"), "showlegend": False},
            *after,
        ],
        "layout": layout(
            470,
            margin={"l": 0, "r": 0, "t": 30, "b": 0},
            scene={**scene, "domain": {"x": [0, 0.495], "y": [0, 1]}},
            scene2={**scene, "domain": {"x": [0.505, 1], "y": [0, 1]}},
            legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "bottom"}
            | {"itemsizing": "constant"},
        ),
    }


def _space_axis(label: str) -> Figure:
    return {
        "title": {"text": label, "font": {"size": 11}},
        "tickfont": {"size": 10},
        "nticks": 5,
        "color": "#55616D",
        "gridcolor": "#D5DBE1",
        "backgroundcolor": "white",
        "zeroline": False,
    }


def _cloud(name: str, points: Cloud, color: str, scene: str) -> Figure:
    x, y, z = np.round(thin(points), 4).T.tolist()
    return {
        "type": "scatter3d",
        "mode": "markers",
        "name": name,
        "scene": scene,
        "x": x,
        "y": y,
        "z": z,
        "marker": {"size": 2.2, "color": color, "opacity": 0.9},
        "hoverinfo": "name",
    }
