"""Figures of what `make bench` measured: latency against error, memory, distance to the ceiling."""

from collections.abc import Iterable, Mapping, Sequence

from pipeline.formats.benchmarks import Benchmarks, Ceiling, Latency, PeakMemory
from pipeline.reporting.figures import (
    BLUE,
    LINE_HEIGHT,
    ORANGE,
    Figure,
    axis,
    category_axis,
    layout,
    legend_beside,
    method_style,
)
from pipeline.reporting.paper import method_rank, shown

SMALLEST_ERROR = 1e-3
"""Degrees; nothing is drawn below."""


def benchmark_figures(found: Benchmarks) -> Mapping[str, Figure]:
    """Draw what there are rows for, by the id of its place on the page."""
    figures = {}
    if found.latencies:
        figures["plot-bench-latency"] = latency_figure(found.latencies)
    if found.memory:
        figures["plot-bench-memory"] = memory_figure(found.memory)
    if any(row.kind == "loop" for row in found.ceilings):
        figures["plot-bench-ceilings"] = ceiling_figure(found.ceilings)
    return figures


def latency_name(row: Latency, whole: int) -> str:
    """Name a method as the legend does: its setting and its points where they are not the usual."""
    setting = "" if row.setting == "paper" else f" ({row.setting})"
    points = "" if row.points == whole else f", first {row.points} points"
    return f"{shown(row.method).name}{setting}{points}"


def in_order(rows: Iterable[Latency]) -> list[Latency]:
    """Put latencies in the order of the tables."""
    return sorted(rows, key=lambda row: (method_rank(row.method), row.setting, -row.points))


def latency_figure(rows: Sequence[Latency]) -> Figure:
    """Draw error against the time of a pair by itself; both axes are logarithmic."""
    whole = max(row.points for row in rows)
    return {
        "data": [_latency_trace(row, whole) for row in in_order(rows)],
        "layout": layout(
            500,
            **legend_beside(),
            xaxis=axis("latency of a pair [ms]", type="log", dtick=1),
            yaxis=axis("ERROR(R) [deg]", type="log", dtick=1),
        ),
    }


def _latency_trace(row: Latency, whole: int) -> Figure:
    style, name = method_style(row.method), latency_name(row, whole)
    said = (
        f"<b>{name}</b><br>{row.latency_ms:.3g} ms a pair, {row.pairs_per_s:.3g} pairs/s"
        f"<br>ERROR(R) {row.error_r_deg:.3g} deg, {row.failures} failures"
    )
    hollow = "-open" * (row.points != whole)
    marker = {"size": 11, "color": style["line"]["color"]}
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": [row.latency_ms],
        "y": [max(row.error_r_deg, SMALLEST_ERROR)],
        "text": [said],
        "customdata": [row.method],
        "hoverinfo": "text",
        "marker": {**marker, "symbol": f"{style['marker']['symbol']}{hollow}"},
        "error_x": {
            "type": "data",
            "array": [row.spread_ms / 2],
            "thickness": 1,
            "color": marker["color"],
        },
    }


def memory_figure(rows: Sequence[PeakMemory]) -> Figure:
    """Draw peak memory against the points of a cloud; on linear axes, so that growth shows."""
    traces = []
    for method in sorted({row.method for row in rows}, key=method_rank):
        mine = sorted((row for row in rows if row.method == method), key=lambda row: row.points)
        traces.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "name": shown(method).name,
                "meta": {"method": method},
                "x": [row.points for row in mine],
                "y": [row.peak_mib for row in mine],
                "text": [f"{row.peak_mib:.0f} MiB, {row.seconds:.2g} s" for row in mine],
                "hoverinfo": "text",
                **method_style(method),
            }
        )
    ticks = sorted({row.points for row in rows})
    return {
        "data": traces,
        "layout": layout(
            340,
            xaxis=axis("points of each cloud", rangemode="tozero", tickvals=ticks, tickangle=-45),
            yaxis=axis("peak memory of the process [MiB]", rangemode="tozero"),
        ),
    }


def ceiling_figure(rows: Sequence[Ceiling]) -> Figure:
    """Draw what share of the machine's rates each loop gets, in arithmetic and in traffic."""
    loops = [row for row in rows if row.kind == "loop"]
    names = [row.name for row in loops]
    ways = (
        ("arithmetic, of the fastest float32 product", BLUE, [row.gflop_share for row in loops]),
        ("traffic, of a copy", ORANGE, [row.gbyte_share for row in loops]),
    )
    bars = [
        {
            "type": "bar",
            "orientation": "h",
            "name": name,
            "x": [100 * share for share in shares],
            "y": names,
            "marker": {"color": color},
            "hovertemplate": "%{x:.1f} %",
        }
        for name, color, shares in ways
    ]
    height = 2 * LINE_HEIGHT * len(names) + 110
    return {
        "data": bars,
        "layout": layout(
            height,
            barmode="group",
            xaxis=axis("share of what the machine can do [%]", rangemode="tozero"),
            yaxis=category_axis(names),
        ),
    }
