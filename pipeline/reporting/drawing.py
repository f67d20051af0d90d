"""What all interactive charts share: how methods look, and one function that draws points.

Points are a frame with ``panel``, ``method``, ``label`` (what the legend says), ``x``, ``y``,
``says`` (shown under the pointer), ``color``, ``symbol``, ``dash`` (empty: not joined by a line)
and, where there are intervals, how far they reach to either side: ``minus`` and ``plus``.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from jaxtyping import Int64
from plotly import graph_objects as go
from plotly.subplots import make_subplots

from pipeline.reporting.paper import METHODS, in_order, shown
from pipeline.reporting.showing import HEADINGS, show_value, unit_of

BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"  # Okabe and Ito
GREY, INK = "#7A7A7A", "#1D2733"
KINDS = {"floor": GREY, "classical": ORANGE, "learned": BLUE}
CYCLE = (
    BLUE,
    RED,
    GREEN,
    "#CC79A7",
    ORANGE,
    "#56B4E9",
    "#000000",
    "#B8A800",
    "#882255",
    "#6E4B9B",
    "#117733",
)
SYMBOLS = ("circle", "square", "diamond", "cross", "x", "pentagon", "star", "hexagram",
           "star-diamond", "octagon", "hourglass")  # fmt: skip
TRIANGLES = tuple(
    f"triangle-{way}" for way in ("up", "down", "right", "ne", "sw", "nw", "se", "left")
)
DASHES = {"floor": "dot", "classical": "dash", "learned": "solid"}
LOG = {"type": "log", "dtick": 1}
LOG_LABELLED = {"type": "log", "dtick": "D2", "minorloglabels": "complete"}
SMALLEST = {"error_r_deg": 1e-3, "error_t": 1e-5}
"""Nothing is drawn smaller than this on a logarithmic axis: it sits there."""


def draw(points: pd.DataFrame, height: int, bars: str = "y") -> go.Figure:
    """Draw points, panel beside panel, with a trace for each look of each method.

    The trace's ``meta`` is its method, so that the page can hide it. A legend names a label once.

    Args:
        points: See the head of this file.
        height: In pixels.
        bars: The axis that intervals lie along, ``x`` or ``y``.
    """
    panels = [*dict.fromkeys(points["panel"])]
    looks = ["panel", "label", "method", "color", "symbol", "dash"]
    traces, columns, named = [], [], set()
    for (panel, label, method, color, symbol, dash), some in points.groupby(looks, sort=False):
        trace = {
            "type": "scatter", "x": some["x"].to_numpy(), "y": some["y"].to_numpy(),
            "mode": "lines+markers" if dash else "markers", "meta": method, "name": label,
            "legendgroup": label, "showlegend": label not in named,
            "hovertext": some["says"].tolist(), "hoverinfo": "text",
            "marker": {"color": color, "symbol": symbol, "size": 8},
            "line": {"color": color, "dash": dash or "solid", "width": 1.6},
        }  # fmt: skip
        if "plus" in some and some["plus"].notna().any():
            reach = {"array": some["plus"].to_numpy(), "arrayminus": some["minus"].to_numpy()}
            trace[f"error_{bars}"] = {"color": color, "thickness": 1.2, "width": 2, **reach}
        named.add(label)
        traces.append(trace)
        columns.append(panels.index(panel) + 1)
    figure = make_subplots(1, len(panels), subplot_titles=panels, horizontal_spacing=0.09)
    figure.add_traces(traces, rows=[1] * len(traces), cols=columns)
    figure.update_annotations(font_size=12)  # the panels' titles
    return figure.update_layout(height=height, template=None)


def by_method(points: pd.DataFrame) -> pd.DataFrame:
    """Give each method's points its colour, its symbol, the dashes of its kind, and its name."""
    styles = [(shown(method).name, *method_style(method)) for method in points["method"]]
    names = ["label", "color", "symbol", "dash"]
    return points.assign(**pd.DataFrame(styles, points.index, names))


def method_style(method: str) -> tuple[str, str, str]:
    """Give a method's colour, symbol and dashes, the same everywhere; no two look the same."""
    kind = shown(method).kind
    same = [name for name, entry in METHODS.items() if entry.kind == kind][::-1]
    index = same.index(method) if method in same else len(same) + len(method)
    symbols = TRIANGLES if kind == "classical" else SYMBOLS
    color = GREY if kind == "floor" else CYCLE[index % len(CYCLE)]
    return color, symbols[index % len(symbols)], DASHES[kind]


def with_intervals(numbers: pd.DataFrame, least: float | pd.Series = 0.0) -> pd.DataFrame:
    """Add ``drawn``, ``minus``, ``plus`` and ``says`` to numbers; none is drawn below ``least``."""
    drawn = numbers["value"].clip(lower=least)
    return numbers.assign(
        drawn=drawn,
        minus=(drawn - numbers["low"].clip(lower=least)).clip(lower=0),
        plus=(numbers["high"] - drawn).clip(lower=0),
        says=[_says(row) for row in numbers.to_dict("records")],
    )


def _says(row: Mapping[str, object]) -> str:
    metric, pairs, failures = str(row["metric"]), row["pairs"], row["failures"]
    value, low, high = (show_value(metric, float(str(row[n]))) for n in ("value", "low", "high"))
    paper = f"<br>paper: {row['paper']}" if pd.notna(row["paper"]) else ""
    return (
        f"<b>{shown(str(row['method'])).name}</b> ({row['written']})<br>{HEADINGS[metric]} {value}"
        f" {unit_of(metric, '')} [{low}, {high}]{paper}<br>{pairs} pairs, {failures} failures"
    )


def with_printed(points: pd.DataFrame) -> pd.DataFrame:
    """Add a point, without an interval, for each that the paper prints a number of."""
    look = {"label": "printed in the paper", "symbol": "diamond-open", "color": INK}
    printed = points[points["paper"].notna()]
    printed = printed.assign(drawn=printed["paper"], minus=np.nan, plus=np.nan, **look)
    return pd.concat([points, printed], ignore_index=True)


def axis_start(numbers: pd.DataFrame, metric: str) -> float:
    """Find where a logarithmic axis may begin: the decade below the smallest thing drawn."""
    found = numbers[["value", "low", "paper"]].to_numpy(dtype=float)
    smallest = np.min(found[found > 0], initial=1.0)
    return max(SMALLEST[metric], float(10 ** np.floor(np.log10(smallest))))


def label_of(metric: str, unit: str) -> str:
    """Name an axis: the quantity and its unit; ``unit`` is the cloud's own."""
    return f"{HEADINGS[metric]} [{unit_of(metric, unit)}]"


def on_lines(figure: go.Figure, names: Sequence[str]) -> go.Figure:
    """Put what has a name on lines, the first of them on top, beside the first panel."""
    order = [*dict.fromkeys(names)][::-1]
    look = {"type": "category", "categoryorder": "array", "categoryarray": order}
    figure.update_yaxes(**look, range=[-0.6, len(order) - 0.4], showticklabels=False)
    return figure.update_yaxes(showticklabels=True, col=1)


def mark_constant(figure: go.Figure, numbers: pd.DataFrame, start: float, column: int = 1) -> None:
    """Draw a dotted line where the constant pose stands, if it is among the numbers."""
    line = {"color": GREY, "width": 1, "dash": "dot"}
    for value in numbers.loc[numbers["method"] == "constant", "value"]:
        figure.add_vline(max(value, start), line=line, layer="below", col=column)


def ranks(methods: pd.Series) -> pd.Series:
    """Give each method its place in the order of the rows, to sort by."""
    order = in_order(methods)
    return methods.map(order.index)


def thinned(count: int, most: int) -> Int64[np.ndarray, " kept"]:
    """Choose at most so many of a row of things, evenly, from the first to the last."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(int))
