"""Charts of what `make bench` measured: latency against error, memory, distance to the ceiling."""

import pandas as pd
import plotly.express as px
from plotly import graph_objects as go

from pipeline.formats.benchmarks import Benchmarks
from pipeline.reporting.charts import LINE_HEIGHT
from pipeline.reporting.drawing import BLUE, LOG, ORANGE, by_method, draw, on_lines, ranks
from pipeline.reporting.paper import shown

SMALLEST_DEG = 1e-3
"""Nothing is drawn below."""


def benchmark_charts(found: Benchmarks) -> dict[str, go.Figure]:
    """Draw what there are rows for, by the id of its place on the page."""
    charts = {}
    if found.latencies:
        charts["plot-bench-latency"] = latency_chart(latency_rows(found))
    if found.memory:
        charts["plot-bench-memory"] = memory_chart(pd.DataFrame(found.memory))
    loops = [row for row in found.ceilings if row.kind == "loop"]
    if loops:
        charts["plot-bench-ceilings"] = ceilings_chart(pd.DataFrame(loops))
    return charts


def latency_rows(found: Benchmarks) -> pd.DataFrame:
    """Put latencies in the order of the tables; ``name`` says setting and points if unusual."""
    rows = pd.DataFrame(found.latencies).sort_values(["setting", "points"], ascending=[True, False])
    rows = rows.sort_values("method", key=ranks, kind="stable", ignore_index=True)
    rows["part"] = rows["points"] != rows["points"].max()
    setting = rows["setting"].map(lambda name: "" if name == "paper" else f" ({name})")
    points = rows["points"].map(lambda count: f", first {count} points").where(rows["part"], "")
    return rows.assign(
        name=rows["method"].map(lambda method: shown(method).name) + setting + points
    )


def latency_chart(rows: pd.DataFrame) -> go.Figure:
    """Draw error against the time of a pair by itself; what had a part of the points is hollow."""
    points = by_method(rows)
    symbols = points["symbol"] + points["part"].map({True: "-open", False: ""})
    said = [
        f"<b>{row.name}</b><br>{row.latency_ms:.3g} ms a pair, {row.pairs_per_s:.3g} pairs/s"
        f"<br>ERROR(R) {row.error_r_deg:.3g} deg, {row.failures} failures"
        for row in rows.itertuples(index=False)
    ]
    points = points.assign(
        panel="", label=rows["name"], symbol=symbols, dash="", says=said,
        x=rows["latency_ms"], y=rows["error_r_deg"].clip(lower=SMALLEST_DEG),
        minus=rows["spread_ms"] / 2, plus=rows["spread_ms"] / 2,
    )  # fmt: skip
    figure = draw(points, 470, bars="x")
    figure.update_xaxes(**LOG, title="latency of a pair [ms]")
    return figure.update_yaxes(**LOG, title="ERROR(R) [deg]")


def memory_chart(rows: pd.DataFrame) -> go.Figure:
    """Draw peak memory against the points of a cloud; on linear axes, so that growth shows."""
    said = [f"{row.peak_mib:.0f} MiB, {row.seconds:.2g} s" for row in rows.itertuples()]
    points = by_method(rows.assign(x=rows["points"], y=rows["peak_mib"], says=said, panel=""))
    points = points.sort_values("points").sort_values("method", key=ranks, kind="stable")
    figure = draw(points, 340)
    ticks = sorted({*rows["points"]})
    figure.update_xaxes(tickvals=ticks, tickangle=-45, title="points of each cloud")
    figure.update_yaxes(title="peak memory of the process [MiB]")
    return figure.update_xaxes(rangemode="tozero").update_yaxes(rangemode="tozero")


def ceilings_chart(rows: pd.DataFrame) -> go.Figure:
    """Draw what share of the machine's rates each loop gets, in arithmetic and in traffic."""
    ways = {
        "gflop_share": "arithmetic, of the fastest float32 product",
        "gbyte_share": "traffic, of a copy",
    }
    shares = rows.rename(columns=ways).melt("name", [*ways.values()], "way", "share")
    figure = px.bar(
        shares.assign(percent=100 * shares["share"]), x="percent", y="name", color="way",
        barmode="group", color_discrete_sequence=[BLUE, ORANGE],
        labels={"percent": "share of what the machine can do [%]", "name": "", "way": ""},
    )  # fmt: skip
    on_lines(figure, [*rows["name"]])
    return figure.update_layout(height=2 * LINE_HEIGHT * len(rows) + 110, template=None)
