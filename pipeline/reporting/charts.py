"""The interactive charts of results: errors, ablations, steps, speed, difficulty, training."""

from collections.abc import Iterable

import numpy as np
import pandas as pd
from plotly import graph_objects as go

from pcrdiff.verdict import reliability_curve
from pipeline.reporting.drawing import (
    BLUE,
    CYCLE,
    GREY,
    KINDS,
    LOG,
    LOG_LABELLED,
    SMALLEST,
    axis_start,
    by_method,
    draw,
    label_of,
    mark_constant,
    on_lines,
    ranks,
    thinned,
    with_intervals,
    with_printed,
)
from pipeline.reporting.paper import (
    ERRORS,
    TIMING,
    UNSEEN_OBJECTS,
    in_order,
    method_rank,
    named,
    place,
    setting_rank,
    shown,
    source_of,
    varied,
)
from pipeline.reporting.reading import STARTS, Training, choose
from pipeline.reporting.showing import show_short, unit_of

LINE_HEIGHT = 22
"""Pixels of a category; the page takes them away with the methods it hides."""
KIND_SYMBOLS = {"floor": "square", "classical": "triangle-up", "learned": "circle"}
"""A second sign of the kind, for eyes and printers that do not tell the colours apart."""
WIDE = 20
"""Ratio of largest to smallest from which an axis is logarithmic."""
NOT_TIMED = 1e-6
"""Seconds below which a printed time is a bound ("< 1e-10"), drawn at the edge."""
COSTS = {"seconds": "time for a pair [s]", "peak_memory_mib": "peak memory while registering [MiB]"}
DIFFICULTIES = {
    "rotation_deg": "true rotation angle [deg]",
    "overlap": "overlap [share of source points]",
    "noise": "jitter, standard deviation [unit sphere]",
}
MEASURES = {
    "error_r_deg": "mean ERROR(R) [deg]",
    "median_error_r_deg": "median ERROR(R) [deg]",
    "below_5_deg_percent": "pairs below 5° [%]",
    "error_t": "mean ERROR(t) [unit sphere]",
}
SMALLEST_BINNED = 1e-4


def headlines(numbers: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Pick a metric of one line of each method: all pairs, the paper's setting where it was run."""
    return choose(numbers, headline=True, kind="line", subset="all", metric=metric)


def errors_chart(numbers: pd.DataFrame, scenario: str, metric: str, unit: str) -> go.Figure:
    """Draw the methods of one scenario against error; all scenarios share one logarithmic scale."""
    chosen = headlines(numbers, metric)
    names = [shown(method).name for method in in_order(chosen["method"])]
    start = axis_start(chosen, metric)
    here = with_intervals(choose(chosen, scenario=scenario), start)
    kinds = here["method"].map(lambda method: shown(method).kind)
    symbols = kinds.map(KIND_SYMBOLS).mask(here["value"] < start, "triangle-left")
    looks = {"label": kinds, "color": kinds.map(KINDS), "symbol": symbols}
    points = with_printed(here.assign(panel="", dash="", **looks))
    y = points["method"].map(lambda method: shown(method).name)
    figure = draw(points.assign(x=points["drawn"], y=y), LINE_HEIGHT * len(names) + 60, bars="x")
    on_lines(figure, names)
    mark_constant(figure, here, start)
    top = np.nanmax([10 * start, *chosen["high"], *chosen["paper"]])
    extent = np.log10([start / 1.6, top * 1.6]).tolist()
    figure.update_xaxes(**LOG, range=extent, title=label_of(metric, unit))
    return figure.update_layout(showlegend=False, margin={"l": 20, "r": 12, "t": 8, "b": 44})


def ablated(numbers: pd.DataFrame, ablation: str, kind: str = "line") -> pd.DataFrame:
    """Pick both mean errors of an ablation's settings, on all pairs of unseen objects."""
    place = {"ablation": ablation, "scenario": UNSEEN_OBJECTS, "subset": "all", "kind": kind}
    return choose(numbers[numbers["metric"].isin(ERRORS)], **place)


def ablation_chart(numbers: pd.DataFrame, ablation: str, unit: str) -> go.Figure:
    """Draw an ablation's settings against error: rotation at the left, translation at the right."""
    rows = ablated(numbers, ablation)
    keys = [
        (method_rank(row.method), pd.isna(row.paper), setting_rank(row.setting)[1])
        for row in rows.itertuples()
    ]
    rows = rows.iloc[sorted(range(len(rows)), key=keys.__getitem__)]  # what the paper has first
    starts = {metric: axis_start(choose(rows, metric=metric), metric) for metric in ERRORS}
    looks = {"label": "ours, 95 % interval", "color": BLUE, "symbol": "circle", "dash": ""}
    points = with_intervals(rows, rows["metric"].map(starts)).assign(**looks)
    points = with_printed(points.assign(panel=[label_of(name, unit) for name in rows["metric"]]))
    names = [*map(ablated_name, points["method"], points["setting"])]
    height = LINE_HEIGHT * len({*names}) + 110
    figure = on_lines(draw(points.assign(x=points["drawn"], y=names), height, bars="x"), names)
    for column, metric in enumerate(ERRORS, start=1):
        drawn = choose(points[points["drawn"] > 0], metric=metric)["drawn"]
        wide = drawn.max() > WIDE * drawn.min()
        figure.update_xaxes(**(LOG if wide else {"rangemode": "tozero"}), col=column)
        here = choose(headlines(numbers, metric), scenario=UNSEEN_OBJECTS)
        mark_constant(figure, here, starts[metric], column)
    return figure.update_layout(legend={"orientation": "h", "y": 0, "yref": "container"})


def ablated_name(method: str, setting: str) -> str:
    """Say which line of an ablation this is: the method and the values, without their keys."""
    values = varied(setting)
    said = ", ".join(values.values()).replace("_", " ")
    if "diffusion" in values:
        said += " diffusion"
    if "hypotheses" in values:
        said += f" random start{'s' * (said != '1')}"
    return f"{shown(method).name}, {said}"


def steps_chart(numbers: pd.DataFrame, unit: str) -> go.Figure:
    """Draw error against sampling steps: rotation at the left, translation at the right.

    A line for each sampler, with the intervals over pairs; strokes are further draws of the noise.
    """
    rows = pd.concat([ablated(numbers, "steps", kind) for kind in ("line", "draw")])
    samplers = rows["sampler"].fillna("ddpm")
    names = rows["method"].map(lambda method: shown(method).name)
    points = with_intervals(rows).assign(
        sampler=samplers,
        label=names + ", " + samplers.str.upper(),
        x=rows["steps"].astype(int),
        panel=[label_of(metric, unit) for metric in rows["metric"]],
    )
    points = points.sort_values(["metric", "method", "sampler", "x"], kind="stable")
    points = points.sort_values("kind", ascending=False, kind="stable")  # strokes last
    is_draw, sampler = points["kind"] == "draw", points["sampler"]
    points = points.assign(
        symbol=sampler.map({"ddpm": "circle", "ddim": "square"}).mask(is_draw, "line-ew-open"),
        dash=sampler.map({"ddpm": "solid", "ddim": "dot"}).mask(is_draw, ""),
        minus=points["minus"].mask(is_draw),
        plus=points["plus"].mask(is_draw),
        color=[CYCLE[index % len(CYCLE)] for index in pd.factorize(points["label"])[0]],
    )
    points = with_printed(points)
    figure = draw(points.assign(y=points["drawn"]), 380)
    figure.update_xaxes(type="log", tickvals=sorted({*points["x"]}), title="sampling steps")
    return figure.update_yaxes(rangemode="tozero")


def starts_chart(numbers: pd.DataFrame, scenario: str) -> go.Figure:
    """Draw the share of pairs found against the number of starts; at the right, against time.

    A line for each source of starts. Where a scenario has no times of its own, those of another
    stand for them, and the axis says whose they are.
    """
    rows = choose(numbers, ablation=STARTS, kind="line", subset="all")
    seconds = choose(rows, metric="seconds")
    points = choose(rows, scenario=scenario, metric="below_5_deg_percent")
    sources = zip(points["method"], map(source_of, points["setting"]), strict=True)
    points = by_method(with_intervals(points)).assign(
        label=[named(*source) for source in sources],
        x=points["starts"].astype(int),
        y=points["value"],
        panel="by number of starts",
    )
    points = points.sort_values(["label", "x"]).sort_values("method", key=ranks, kind="stable")
    points["color"] = [CYCLE[index % len(CYCLE)] for index in pd.factorize(points["label"])[0]]
    others = seconds["scenario"].iloc[:1]
    where = scenario if (seconds["scenario"] == scenario).any() else "".join(others)
    times = choose(seconds, scenario=where).set_index(["method", "setting"])["value"]
    timed = points.join(times.rename("seconds"), on=["method", "setting"]).dropna(subset="seconds")
    timed = timed.assign(x=1e3 * timed["seconds"], panel="by time")
    figure = draw(pd.concat([points, timed]), 420)
    measured = f", measured on {place(where).title}" if where else ""
    figure.update_xaxes(**LOG_LABELLED, title=f"time for a pair [ms]{measured}", col=2)
    counts = sorted({*points["x"]})
    figure.update_xaxes(type="log", tickvals=counts, title="number of starts", col=1)
    figure.update_yaxes(range=[-3, 103])
    return figure.update_yaxes(title=MEASURES["below_5_deg_percent"], col=1)


def speed_chart(numbers: pd.DataFrame) -> go.Figure:
    """Draw error against seconds per pair at the left, against memory at the right."""
    timed = choose(numbers, table=TIMING.table, kind="line")
    errors = choose(timed, metric="error_r_deg")
    errors = with_intervals(errors, axis_start(errors, "error_r_deg"))
    line = ["method", "setting"]
    errors = errors[[*line, "drawn", "minus", "plus", "says", "paper"]]
    costs = timed[timed["metric"].isin([*COSTS])].sort_values("method", key=ranks, kind="stable")
    costs = by_method(costs.merge(errors, on=line, suffixes=("", "_of_error")))
    others = costs["setting"].map(lambda name: "" if name == "paper" else f" ({name})")
    said = [
        f"{row.says}<br>{show_short(row.value)} {unit_of(row.metric, '')}"
        for row in costs.itertuples()
    ]
    costs = costs.assign(
        panel=costs["metric"].map(COSTS), label=costs["label"] + others, dash="", says=said,
        x=costs["value"], y=costs["drawn"],
    )  # fmt: skip
    points = pd.concat([costs, _printed_costs(costs)])
    figure = draw(points.sort_values("metric", ascending=False, kind="stable"), 480)
    figure.update_xaxes(**LOG, col=1).update_xaxes(**LOG_LABELLED, col=2)
    return figure.update_yaxes(**LOG).update_yaxes(title="ERROR(R) [deg]", col=1)


def _printed_costs(costs: pd.DataFrame) -> pd.DataFrame:
    """Draw what the paper prints hollow; a bound on a time sits at the left edge, as a triangle."""
    seconds = choose(costs, metric="seconds")
    printed = choose(seconds, setting="paper").dropna(subset=["paper", "paper_of_error"])
    fastest = max(seconds["value"].min(), NOT_TIMED)
    bound = printed["paper"] < NOT_TIMED
    return printed.assign(
        x=printed["paper"].mask(bound, 10 ** (np.floor(np.log10(fastest)) - 1)),
        y=printed["paper_of_error"],
        symbol=(printed["symbol"] + "-open").mask(bound, "triangle-left-open"),
        says=[
            f"<b>{row.label}</b>, paper<br>{'below ' * (row.paper < NOT_TIMED)}{row.paper:g} s"
            f"<br>ERROR(R) {row.paper_of_error:g} deg"
            for row in printed.itertuples()
        ],
        minus=np.nan, plus=np.nan,
    )  # fmt: skip


def difficulty_chart(numbers: pd.DataFrame, metric: str) -> go.Figure | None:
    """Draw a metric against rotation angle, overlap and noise; None if nothing was binned."""
    noise = numbers["noise"].where(numbers["kind"] == "line").astype(float)
    middle = ((numbers["bin_low"] + numbers["bin_high"]) / 2).fillna(noise)
    rows = numbers.assign(by=numbers["by"].mask(noise.notna(), "noise"), middle=middle)
    rows = choose(rows[middle.notna()], metric=metric, subset="all")
    if rows.empty:
        return None
    percent = metric.endswith("_percent")
    points = by_method(with_intervals(rows, 0.0 if percent else SMALLEST_BINNED))
    points = points.assign(
        order=ranks(points["method"]),
        rank=points["by"].map([*DIFFICULTIES].index),
        x=points["middle"] + _aside(points),
    )
    points = points.sort_values(["rank", "order", "middle"], kind="stable")
    figure = draw(points.assign(panel=points["by"].map(DIFFICULTIES), y=points["drawn"]), 480)
    for column, (_, panel) in enumerate(points.groupby("rank"), start=1):
        figure.update_xaxes(tickvals=sorted({*panel["middle"]}), col=column)
    figure.update_yaxes(**({"range": [-3, 103]} if percent else LOG))
    return figure.update_yaxes(title=MEASURES[metric], col=1)


def _aside(points: pd.DataFrame) -> pd.Series:
    """Shift the methods of a panel apart, by half the narrowest bin altogether."""
    panel = points["by"]
    place = ranks(points["method"]).groupby(panel).rank("dense")
    count = place.groupby(panel).transform("max")
    narrowest = (
        points["middle"]
        .groupby(panel)
        .transform(lambda middles: min(np.diff(np.unique(middles)), default=1.0))
    )
    return 0.5 * narrowest * (place - (1 + count) / 2) / count


def distribution_chart(answers: pd.DataFrame, scenario: str, unit: str) -> go.Figure:
    """Draw the share of pairs below each error: rotation at the left, translation at the right."""
    here = choose(answers, headline=True, scenario=scenario)
    points = cumulative(here.melt("method", [*ERRORS], "metric", "error"))
    points = points.sort_values("method", key=ranks, kind="stable")
    points = points.sort_values("metric", kind="stable")
    points = points.assign(
        says=[f"{y:.0f} % of pairs at most {x:.3g}" for x, y in points[["x", "y"]].to_numpy()],
        panel=[label_of(metric, unit) for metric in points["metric"]],
    )
    figure = draw(by_method(points), 480)
    figure.update_traces(line_shape="hv", marker_maxdisplayed=5)
    figure.update_xaxes(**LOG).update_yaxes(range=[0, 101])
    return figure.update_yaxes(title="share of pairs with at most this error [%]", col=1)


def cumulative(errors: pd.DataFrame, most: int = 120) -> pd.DataFrame:
    """Give, for each metric and method, the percentage of pairs (y) up to each error (x), thinned.

    Args:
        errors: A row per pair and metric: ``method``, ``metric``, ``error``.
        most: How many points of a line are kept.
    """
    least = errors["metric"].map(SMALLEST)
    errors = errors.assign(error=errors["error"].clip(lower=least)).sort_values("error")
    errors = errors.sort_values(["metric", "method"], kind="stable")
    line = errors.groupby(["metric", "method"])["error"]
    place, count = line.cumcount(), line.transform("count")
    kept = place.isin(thinned(int(count.max()), most))  # methods have the same pairs
    points = errors.assign(x=errors["error"], y=100 * (place + 1) / count)[kept]
    rounded = {name: [float(f"{value:.4g}") for value in points[name]] for name in "xy"}
    return points.assign(**rounded)


def reliability_chart(answers: pd.DataFrame, scenario: str) -> go.Figure:
    """Draw the share of right answers against their probability; at the right, how many there are.

    A line for each method and setting that gives its answers a probability.
    """
    known = choose(answers[answers["probability"].notna()], scenario=scenario, ablation="")
    panels = {"observed": "share of right answers", "counts": "answers"}
    lines = [
        _reliability(method, setting, some).assign(panel=panel, column=column)
        for column, panel in panels.items()
        for (method, setting), some in known.groupby(["method", "setting"])
    ]
    points = pd.concat(lines, ignore_index=True)
    points = points.assign(
        y=[row[row["column"]] for row in points.to_dict("records")],
        color=[CYCLE[index % len(CYCLE)] for index in pd.factorize(points["label"])[0]],
        symbol="circle",
        dash="solid",
    )
    figure = draw(points, 380)
    line = {"color": GREY, "width": 1, "dash": "dot"}
    figure.add_shape(type="line", x0=0, y0=0, x1=1, y1=1, line=line, layer="below", row=1, col=1)
    figure.update_xaxes(range=[-0.03, 1.03], title="probability of being right")
    figure.update_yaxes(rangemode="tozero", col=2)
    return figure.update_yaxes(range=[-0.03, 1.03], col=1)


def _reliability(method: str, setting: str, answers: pd.DataFrame) -> pd.DataFrame:
    """Give a point for each bin of the answers of one method in one setting."""
    probability, right = answers["probability"].to_numpy(), answers["right"].to_numpy()
    points = pd.DataFrame(reliability_curve(probability, right)._asdict())
    says = [
        f"{counts} answers of probability {predicted:.2f}<br>{100 * observed:.0f} % right"
        for predicted, observed, counts in points.itertuples(index=False)
    ]
    return points.assign(
        method=method, label=named(method, setting), x=points["predicted"], says=says
    )


def curves_chart(trainings: Iterable[Training]) -> go.Figure:
    """Draw the trainings of one scenario: loss at the left, validation error at the right."""
    panels = {"loss": "training loss", "val_error_r_deg": "validation ERROR(R) [deg]"}
    points = pd.concat(
        [
            curve_points(one.curve, column).assign(method=one.method, panel=panel)
            for column, panel in panels.items()
            for one in trainings
        ]
    )
    says = [f"step {x:g}: {y:.4g}" for x, y in points[["x", "y"]].to_numpy()]
    figure = draw(by_method(points.assign(says=says)), 360)
    figure.update_traces(marker_maxdisplayed=12)
    figure.update_xaxes(rangemode="tozero", title="training step")
    return figure.update_yaxes(**LOG_LABELLED)


def curve_points(curve: pd.DataFrame, column: str, most: int = 500) -> pd.DataFrame:
    """Give a column (y) by its training steps (x), leaving gaps out and thinning long curves."""
    points = curve.reindex(columns=["step", column]).set_axis(["x", "y"], axis=1).dropna()
    return points.iloc[thinned(len(points), most)]
