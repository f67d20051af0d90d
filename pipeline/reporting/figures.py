"""Interactive figures as plain plotly dictionaries: their common look, errors, training curves."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.reporting.background import Training
from pipeline.reporting.overlays import headline_scores
from pipeline.reporting.paper import METHODS, method_rank, shown
from pipeline.reporting.result_files import Scores
from pipeline.reporting.tables import Row
from pipeline.reporting.views import main_rows

Figure = dict[str, Any]
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"  # Okabe and Ito
GREY, INK, GRID = "#7A7A7A", "#1D2733", "#E4E8EC"
KINDS = {"floor": GREY, "classical": ORANGE, "learned": BLUE}
KIND_SYMBOLS = {"floor": "square", "classical": "triangle-up", "learned": "circle"}
"""A second sign of the kind, for eyes and printers that do not tell the colours apart."""
CYCLE = (BLUE, RED, GREEN, "#CC79A7", ORANGE, "#56B4E9", "#000000", "#B8A800", "#882255", "#6E4B9B")
SYMBOLS = {
    "floor": ("square", "circle", "diamond"),
    "classical": tuple(f"triangle-{way}" for way in ("up", "down", "right", "ne", "sw", "nw", "se")),
    "learned": ("circle", "square", "diamond", "cross", "x", "pentagon", "star", "hexagram",
                "star-diamond", "octagon"),
}  # fmt: skip
DASHES = {"floor": "dot", "classical": "dash", "learned": "solid"}
SMALLEST = {"error_r_deg": 1e-3, "error_t": 1e-5}
"""Nothing is drawn smaller than this on a logarithmic axis: it sits there, as a triangle."""
FONT = {"family": "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif", "size": 12}
HALVES = ([0, 0.46], [0.54, 1])
LINE_HEIGHT = 22
"""Pixels of a category; the page takes them away with the methods it hides."""
DISTRIBUTION_POINTS = 120


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


def legend_beside() -> Figure:
    """A legend at the right, one name a line, for figures of many methods."""
    margin = {"l": 60, "r": 190, "t": 30, "b": 50}
    return {
        "margin": margin,
        "legend": {"x": 1.01, "y": 1, "font": {"size": 11}, "tracegroupgap": 0},
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


def category_axis(names: Sequence[str], **more: object) -> Figure:
    """An axis of names, the first of them on top."""
    return axis(
        None,
        type="category",
        categoryorder="array",
        categoryarray=[*reversed(names)],
        range=[-0.6, len(names) - 0.4],
        **more,
    )


def whose_lines(methods: Sequence[str]) -> Figure:
    """Tell the page whose each category is and how high, from the axis upwards."""
    return {"categories": [*reversed(methods)], "line_height": LINE_HEIGHT}


def axis_names(index: int) -> tuple[str, str]:
    """Name the axes of a panel, as its traces do."""
    suffix = str(index + 1) if index else ""
    return f"x{suffix}", f"y{suffix}"


def axis_start(rows: Iterable[Row], metric: str) -> float:
    """Find where a logarithmic axis may begin: the decade below the smallest thing drawn."""
    numbers = [x for row in rows for x in (row.value, row.low, row.paper) if x]
    smallest = min(numbers, default=1.0)
    return max(SMALLEST[metric], float(10 ** np.floor(np.log10(smallest))))


def method_color(method: str) -> str:
    """Give a method its colour, the same in every figure; no two learned ones share it."""
    return GREY if shown(method).kind == "floor" else CYCLE[_index(method) % len(CYCLE)]


def method_style(method: str) -> Figure:
    """Give a method's line: colour, a dash for its kind, a symbol of its own within the kind."""
    kind = shown(method).kind
    style = {"color": method_color(method), "dash": DASHES[kind], "width": 1.6}
    symbol = SYMBOLS[kind][_index(method) % len(SYMBOLS[kind])]
    return {"line": style, "marker": {"symbol": symbol, "size": 7, "color": style["color"]}}


def _index(method: str) -> int:
    kind = shown(method).kind
    alike = [name for name, entry in METHODS.items() if entry.kind == kind][::-1]
    return alike.index(method) if method in alike else len(alike) + len(method)


def interval(rows: Sequence[Row], values: Sequence[float], start: float, color: str) -> Figure:
    """Draw the intervals of rows around what is drawn of them, none below ``start``."""
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


def hover(row: Row) -> str:
    """Say all that a row holds."""
    paper = "" if row.paper is None else f"<br>paper: {row.paper}"
    return (
        f"<b>{shown(row.method).name}</b> ({row.setting})<br>{row.value:g}"
        f" [{row.low:g}, {row.high:g}]{paper}<br>{row.pairs} pairs, {row.failures} failures"
    )


def points(name: str, rows: Sequence[Row], x: Sequence[Any], y: Sequence[Any]) -> Figure:
    """Put a mark at each row; ``customdata`` tells the page's filter whose it is."""
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "legendgroup": name,
        "x": [*x],
        "y": [*y],
        "text": [hover(row) for row in rows],
        "customdata": [row.method for row in rows],
        "hoverinfo": "text",
    }


def errors_figure(rows: Sequence[Row], scenario: str, metric: str, label: str) -> Figure:
    """Draw the methods of one scenario against error; all scenarios share one logarithmic scale."""
    chosen = main_rows(rows, metric)
    methods = sorted({method for _, method in chosen}, key=method_rank)
    start = axis_start(chosen.values(), metric)
    top = max([10 * start, *(x for row in chosen.values() for x in (row.high, row.paper or 0))])
    here = [chosen[scenario, method] for method in methods if (scenario, method) in chosen]
    extent = [float(np.log10(start / 1.6)), float(np.log10(top * 1.6))]
    return {
        "data": _error_traces(here, start),
        "layout": layout(
            LINE_HEIGHT * len(methods) + 60,
            margin={"l": 20, "r": 12, "t": 8, "b": 44},
            showlegend=False,
            xaxis=axis(label, type="log", range=extent, dtick=1),
            yaxis=category_axis([shown(method).name for method in methods]),
            shapes=constant_line(here, start),
            meta=whose_lines(methods),
        ),
    }


def _error_traces(rows: Sequence[Row], start: float) -> list[Figure]:
    traces = []
    for kind, color in KINDS.items():
        ours = [row for row in rows if shown(row.method).kind == kind]
        own = KIND_SYMBOLS[kind]
        symbols = ["triangle-left" if row.value < start else own for row in ours]
        values = [max(row.value, start) for row in ours]
        traces.append(
            {
                **points(kind, ours, values, [shown(row.method).name for row in ours]),
                "marker": {"color": color, "size": 9, "symbol": symbols},
                "error_x": interval(ours, values, start, color),
            }
        )
    return [*traces, *_printed(rows)]


def _printed(rows: Sequence[Row]) -> list[Figure]:
    theirs = [row for row in rows if row.paper is not None]
    names = [shown(row.method).name for row in theirs]
    trace = points("printed in the paper", theirs, [row.paper for row in theirs], names)
    return [{**trace, "marker": PAPER_MARKER}] if theirs else []


PAPER_MARKER = {"color": INK, "size": 9, "symbol": "diamond-open", "line": {"width": 1.5}}


def constant_line(rows: Iterable[Row], start: float, x: str = "x") -> list[Figure]:
    """Draw where the constant pose stands on the axis ``x``, if it is among the rows."""
    at = [max(row.value, start) for row in rows if row.method == "constant"]
    where = {"xref": x, "yref": "paper", "y0": 0, "y1": 1, "layer": "below"}
    line = {"color": GREY, "width": 1, "dash": "dot"}
    return [{"type": "line", "x0": value, "x1": value, "line": line, **where} for value in at]


def distribution_figure(scores: Iterable[Scores], scenario: str, unit: str) -> Figure:
    """Draw the share of pairs below each error: rotation at the left, translation at the right."""
    labels = {"error_r_deg": "rotation error [deg]", "error_t": f"translation error [{unit}]"}
    found = headline_scores(scores, scenario)
    figure: Figure = {"data": [], "layout": layout(470, **legend_beside())}
    for index, (metric, label) in enumerate(labels.items()):
        x, y = axis_names(index)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            label, type="log", domain=HALVES[index], anchor=y, dtick=1
        )
        share = "share of pairs with at most this error [%]" if index == 0 else None
        figure["layout"][f"yaxis{y[1:]}"] = axis(share, range=[0, 101], anchor=x)
        for method, one in found.items():
            errors, shares = cumulative(one, metric)
            trace = {
                "type": "scatter",
                "mode": "lines+markers",
                "name": shown(method).name,
                "legendgroup": method,
                "meta": {"method": method},
                "x": errors,
                "y": shares,
                **method_style(method),
                "hovertemplate": "%{y:.0f} % of pairs at most %{x:.3g}",
            }
            trace["line"] = {**trace["line"], "shape": "hv"}
            trace["marker"] = {**trace["marker"], "maxdisplayed": 5}
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
    return figure


def cumulative(scores: Scores, metric: str) -> tuple[list[float], list[float]]:
    """Give errors in ascending order and the percentage of pairs up to each, thinned."""
    errors = np.sort(np.maximum(scores.numbers[metric], SMALLEST[metric]))
    places = np.linspace(0, len(errors) - 1, min(DISTRIBUTION_POINTS, len(errors)))
    kept = np.unique(places.round().astype(int))
    shares = 100 * (kept + 1) / len(errors)
    return [float(f"{x:.4g}") for x in errors[kept]], [float(f"{x:.4g}") for x in shares]


def curves_figure(trainings: Sequence[Training]) -> Figure:
    """Draw the trainings of one scenario: loss at the left, validation error at the right."""
    figure: Figure = {"data": [], "layout": layout(380, **legend_beside())}
    panels = {"loss": "training loss", "val_error_r_deg": "validation ERROR(R) [deg]"}
    for index, (column, label) in enumerate(panels.items()):
        x, y = axis_names(index)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            "training step", domain=HALVES[index], anchor=y, rangemode="tozero"
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(
            label, type="log", dtick="D2", minorloglabels="complete", anchor=x
        )
        for training in trainings:
            steps, values = curve_points(training.curve, column)
            style = method_style(training.method)
            trace = {
                "type": "scatter",
                "mode": "lines+markers",
                "name": shown(training.method).name,
                "legendgroup": training.method,
                "meta": {"method": training.method},
                "x": steps,
                "y": values,
                "line": style["line"],
                "marker": {**style["marker"], "maxdisplayed": 12},
                "hovertemplate": "step %{x}: %{y:.4g}",
            }
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
    return figure


def curve_points(
    curve: Mapping[str, Sequence[float | None]], column: str, most: int = 500
) -> tuple[list[float], list[float]]:
    """Pair a column with its training steps, leaving gaps out and thinning long curves."""
    steps = curve.get("step", [])
    pairs = [
        (step, value)
        for step, value in zip(steps, curve.get(column, [None] * len(steps)), strict=True)
        if step is not None and value is not None
    ]
    kept = np.unique(np.linspace(0, len(pairs) - 1, min(most, len(pairs))).astype(int))
    return [pairs[i][0] for i in kept], [float(f"{pairs[i][1]:.5g}") for i in kept]
