"""Figures of the paper's studies: ablations, sampling steps, speed, and what makes a pair hard."""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from pipeline.reporting.figures import (
    CYCLE,
    HALVES,
    INK,
    KINDS,
    LINE_HEIGHT,
    PAPER_MARKER,
    Figure,
    axis,
    axis_names,
    axis_start,
    category_axis,
    constant_line,
    hover,
    interval,
    layout,
    legend_beside,
    method_style,
    points,
    whose_lines,
)
from pipeline.reporting.paper import method_rank, shown
from pipeline.reporting.tables import Row
from pipeline.reporting.views import natural

STEPS = re.compile(r"steps=(\d+)(?:,sampler=(\w+))?(?:,draw=(\d+))?")
BINS = re.compile(r"(rotation_deg|overlap)=([\d.]+)-([\d.]+)|(noise)=([\d.]+)")
ABLATED = {"3": "diffusion", "4": "representation", "5": "fusion", "extra": "hypotheses"}
"""By table, what the first key of a setting is."""
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
WIDE = 20
"""Ratio of largest to smallest from which an axis is logarithmic."""
NOT_TIMED = 1e-6
"""Seconds below which a printed time is a bound ("< 1e-10"), drawn at the edge."""


def whole(rows: Iterable[Row]) -> list[Row]:
    """Keep what was measured on all pairs by one method; no contrasts, no subsets."""
    return [row for row in rows if row.subset == "all" and " minus " not in row.setting]


def error_labels(unit: str) -> dict[str, str]:
    """Label the two mean errors by metric."""
    return {"error_r_deg": "ERROR(R) [deg]", "error_t": f"ERROR(t) [{unit}]"}


# Tables 3 to 5.


def ablation_rows(rows: Iterable[Row], table: str) -> list[Row]:
    """Pick the rows of one ablation, method by method; what the paper has comes first."""
    key = f"{ABLATED[table]}="
    found = [r for r in whole(rows) if r.table == table and r.setting.startswith(key)]
    return sorted(
        found, key=lambda row: (method_rank(row.method), row.paper is None, natural(row.setting))
    )


def ablation_figure(rows: Sequence[Row], unit: str, floors: Iterable[Row] = ()) -> Figure:
    """Draw settings against error: rotation at the left, translation at the right.

    Args:
        rows: Those of one ablation.
        unit: Its unit of length.
        floors: Rows of its scenario; the constant pose among them is a dotted line.
    """
    constant = [row for row in floors if row.method == "constant"]
    lines = list(dict.fromkeys((row.method, row.setting) for row in rows))
    names = [ablated_name(*line) for line in lines]
    figure: Figure = {"data": [], "layout": layout(LINE_HEIGHT * len(names) + 120)}
    figure["layout"]["meta"] = whose_lines([method for method, _ in lines])
    figure["layout"]["margin"] = {"l": 60, "r": 16, "t": 34, "b": 50}
    for index, (metric, label) in enumerate(error_labels(unit).items()):
        x, y = axis_names(index)
        chosen = [row for row in rows if row.metric == metric]
        start = axis_start(chosen, metric)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            label, domain=([0, 0.48], [0.52, 1])[index], anchor=y, **_scale(chosen, start)
        )
        figure["layout"][f"yaxis{y[1:]}"] = category_axis(
            names, anchor=x, showticklabels=index == 0
        )
        for trace in _ablation_traces(chosen, start):
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": index == 0})
        at = [row for row in constant if row.metric == metric]
        figure["layout"].setdefault("shapes", []).extend(constant_line(at, start, x))
    return figure


def _scale(rows: Sequence[Row], start: float) -> Figure:
    """Start at zero, unless the largest would hide the smallest."""
    drawn = [max(value, start) for row in rows for value in (row.value, row.paper) if value]
    if max(drawn, default=1.0) < WIDE * min(drawn, default=1.0):
        return {"rangemode": "tozero"}
    return {"type": "log", "dtick": "D2", "minorloglabels": "complete"}


def ablated_name(method: str, setting: str) -> str:
    """Say which line of an ablation this is: the method and the values, without their keys."""
    key = setting.partition("=")[0]
    values = ", ".join(part.partition("=")[2] for part in setting.split(","))
    said = {
        "diffusion": f"{values} diffusion",
        "hypotheses": f"{values} random start{'s' * (values != '1')}",
    }
    return f"{shown(method).name}, {said.get(key, values.replace('_', ' '))}"


def _ablation_traces(rows: Sequence[Row], start: float) -> list[Figure]:
    values = [max(row.value, start) for row in rows]
    ours = {
        **points("ours, 95 % interval", rows, values, [_line_name(row) for row in rows]),
        "marker": {"color": KINDS["learned"], "size": 9},
        "error_x": interval(rows, values, start, KINDS["learned"]),
    }
    theirs = [row for row in rows if row.paper is not None]
    printed = [row.paper for row in theirs]
    names = [_line_name(row) for row in theirs]
    paper = {
        **points("printed in the paper", theirs, printed, names),
        "marker": PAPER_MARKER,
    }
    return [ours, paper] if theirs else [ours]


def _line_name(row: Row) -> str:
    return ablated_name(row.method, row.setting)


# Table 7.


def steps_figure(rows: Sequence[Row], unit: str) -> Figure:
    """Draw error against sampling steps: rotation at the left, translation at the right.

    A line a sampler, with the intervals over pairs; the band behind it goes from the smallest to
    the largest of the draws.

    Args:
        rows: Those of Table 7, of one scenario.
        unit: Its unit of length.
    """
    figure: Figure = {"data": [], "layout": layout(380)}
    chosen = [row for row in whole(rows) if STEPS.fullmatch(row.setting)]
    ticks = sorted({_steps(row) for row in chosen})
    for index, (metric, label) in enumerate(error_labels(unit).items()):
        x, y = axis_names(index)
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            "sampling steps", type="log", tickvals=ticks, domain=HALVES[index], anchor=y
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(label, rangemode="tozero", anchor=x)
        lines: dict[tuple[str, str], list[Row]] = {}
        for row in chosen:
            if row.metric == metric:
                lines.setdefault((row.method, _sampler(row)), []).append(row)
        for number, key in enumerate(sorted(lines)):
            for trace in _step_traces(*key, lines[key], number):
                shows = index == 0 and trace.get("showlegend", True)
                figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": shows})
    return figure


def _parts(row: Row) -> tuple[str | None, ...]:
    found = STEPS.fullmatch(row.setting)
    return found.groups() if found else ()


def _steps(row: Row) -> int:
    return int(_parts(row)[0] or 0)


def _sampler(row: Row) -> str:
    return _parts(row)[1] or "ddpm"


def _step_traces(method: str, sampler: str, rows: Sequence[Row], number: int) -> list[Figure]:
    name, color = f"{shown(method).name}, {sampler.upper()}", CYCLE[number % len(CYCLE)]
    first = sorted((row for row in rows if _parts(row)[2] is None), key=_steps)
    values = [row.value for row in first]
    ours = {
        **points(name, first, [_steps(row) for row in first], values),
        "mode": "lines+markers",
        "line": {"color": color, "dash": "solid" if sampler == "ddpm" else "dot"},
        "marker": {"size": 9, "symbol": "circle" if sampler == "ddpm" else "square"},
        "error_y": interval(first, values, 0.0, color),
    }
    theirs = [row for row in first if row.paper is not None]
    marks = {
        **points(
            f"{shown(method).name}, printed in the paper",
            theirs,
            [_steps(row) for row in theirs],
            [row.paper for row in theirs],
        ),
        "mode": "lines+markers",
        "line": {"color": INK, "dash": "dash", "width": 1.5},
        "marker": PAPER_MARKER,
    }
    return [*_draws_band(name, rows, color), ours, *([marks] if theirs else [])]


def _draws_band(name: str, rows: Sequence[Row], color: str) -> list[Figure]:
    """Shade from the smallest to the largest draw of each number of steps."""
    by_steps: dict[int, list[float]] = {}
    for row in rows:
        by_steps.setdefault(_steps(row), []).append(row.value)
    if all(len(values) < 2 for values in by_steps.values()):
        return []
    steps, common = sorted(by_steps), {"type": "scatter", "mode": "lines", "hoverinfo": "skip"}
    edge = {**common, "line": {"width": 0}, "x": steps, "legendgroup": name, "showlegend": False}
    edge["meta"] = {"method": rows[0].method}
    shade = f"rgba({', '.join(str(int(color[at : at + 2], 16)) for at in (1, 3, 5))}, 0.25)"
    return [
        {**edge, "y": [min(by_steps[step]) for step in steps]},
        {**edge, "y": [max(by_steps[step]) for step in steps], "fill": "tonexty"}
        | {"fillcolor": shade, "name": f"{name}: all draws"},
    ]


# Table 6.


def speed_figure(rows: Iterable[Row]) -> Figure:
    """Draw error against seconds a pair at the left, against memory at the right if measured."""
    cells: dict[tuple[str, str], dict[str, Row]] = {}
    for row in whole(rows):
        cells.setdefault((row.method, row.setting), {})[row.metric] = row
    lines = [cells[key] for key in sorted(cells, key=lambda key: (method_rank(key[0]), key[1]))]
    across = {
        "seconds": "time for a pair [s]",
        "peak_memory_mib": "peak memory while registering [MiB]",
    }
    panels = {m: label for m, label in across.items() if any(m in line for line in lines)}
    figure: Figure = {"data": [], "layout": layout(500, **legend_beside())}
    for index, (metric, label) in enumerate(panels.items()):
        x, y = axis_names(index)
        domain = HALVES[index] if len(panels) > 1 else [0, 1]
        whose = "ERROR(R) [deg]" if index == 0 else None
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            label, type="log", domain=domain, anchor=y, dtick=1
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(whose, type="log", anchor=x, dtick=1)
        here = [line for line in lines if {metric, "error_r_deg"} <= line.keys()]
        for trace in _speed_traces(here, metric):
            shows = index == 0 and trace.get("showlegend", True)
            figure["data"].append({**trace, "xaxis": x, "yaxis": y, "showlegend": shows})
    return figure


def _speed_traces(lines: Sequence[Mapping[str, Row]], metric: str) -> list[Figure]:
    """Draw a method a trace, ours filled and the paper's hollow, so that a legend can name them."""
    traces = []
    start = axis_start([line["error_r_deg"] for line in lines], "error_r_deg")
    fastest = min((line[metric].value for line in lines), default=1.0)
    edge = float(10 ** np.floor(np.log10(max(fastest, NOT_TIMED)) - 1))
    for line in lines:
        cost, error = line[metric], line["error_r_deg"]
        setting = "" if cost.setting == "paper" else f" ({cost.setting})"
        color = method_style(cost.method)["line"]["color"]
        symbol = method_style(cost.method)["marker"]["symbol"]
        value = max(error.value, start)
        trace = points(f"{shown(cost.method).name}{setting}", [cost], [cost.value], [value])
        trace["text"] = [f"{hover(cost)} {_unit(metric)}<br>ERROR(R) {error.value:g} deg"]
        marker = {"color": color, "size": 11, "symbol": symbol}
        errors = {
            "error_x": {**interval([cost], [cost.value], 0.0, color), "thickness": 1},
            "error_y": {**interval([error], [value], start, color), "thickness": 1},
        }
        traces.append({**trace, "marker": marker, **errors})
        if cost.paper is not None and error.paper is not None and cost.setting == "paper":
            bound = cost.paper < NOT_TIMED
            said = f"<b>{shown(cost.method).name}</b>, paper<br>{'below ' * bound}{cost.paper:g} s"
            theirs = {**trace, "x": [edge if bound else cost.paper], "y": [error.paper]}
            theirs |= {"text": [f"{said}<br>ERROR(R) {error.paper:g} deg"], "showlegend": False}
            hollow = "triangle-left-open" if bound else f"{symbol}-open"
            traces.append({**theirs, "marker": {**marker, "symbol": hollow}})
    return traces


def _unit(metric: str) -> str:
    return "s" if metric == "seconds" else "MiB"


# Rotation, overlap, noise.


def difficulty_figure(rows: Iterable[Row], metric: str) -> Figure | None:
    """Draw a metric against rotation angle, overlap and noise; None if nothing was binned."""
    found: dict[str, list[tuple[float, Row]]] = {}
    for row in whole(rows):
        matched = BINS.fullmatch(row.setting)
        if matched and row.metric == metric:
            kind, low, high, noise, deviation = matched.groups()
            middle = float(deviation) if noise else (float(low) + float(high)) / 2
            found.setdefault(noise or kind, []).append((middle, row))
    panels = [kind for kind in DIFFICULTIES if kind in found]
    if not panels:
        return None
    figure: Figure = {"data": [], "layout": layout(470, **legend_beside())}
    seen: set[str] = set()
    for index, kind in enumerate(panels):
        x, y = axis_names(index)
        wide = 1 / len(panels)
        domain = [round(index * wide + 0.04 * (index > 0), 4), round((index + 1) * wide - 0.02, 4)]
        scale = {"range": [-3, 103]} if metric.endswith("_percent") else {"type": "log", "dtick": 1}
        label = MEASURES[metric] if index == 0 else None
        ticks = sorted({middle for middle, _ in found[kind]})
        figure["layout"][f"xaxis{x[1:]}"] = axis(
            DIFFICULTIES[kind], domain=domain, anchor=y, tickvals=ticks
        )
        figure["layout"][f"yaxis{y[1:]}"] = axis(label, anchor=x, **scale)
        for trace in _difficulty_traces(found[kind], metric, seen):
            figure["data"].append({**trace, "xaxis": x, "yaxis": y})
    return figure


def _difficulty_traces(
    binned: Sequence[tuple[float, Row]], metric: str, seen: set[str]
) -> list[Figure]:
    methods = sorted({row.method for _, row in binned}, key=method_rank)
    middles = sorted({middle for middle, _ in binned})
    step = min(np.diff(middles), default=1.0) * 0.5 / max(1, len(methods))
    start = 0.0 if metric.endswith("_percent") else SMALLEST_DRAWN
    traces = []
    for number, method in enumerate(methods):
        mine = sorted(((m, row) for m, row in binned if row.method == method), key=lambda p: p[0])
        rows = [row for _, row in mine]
        values = [max(row.value, start) for row in rows]
        aside = (number - (len(methods) - 1) / 2) * step  # beside each other, not on each other
        style = method_style(method)
        trace = points(shown(method).name, rows, [m + aside for m, _ in mine], values)
        bars = interval(rows, values, start, style["line"]["color"])
        trace |= {**style, "mode": "lines+markers", "showlegend": method not in seen}
        traces.append({**trace, "error_y": {**bars, "thickness": 1, "width": 0}})
        seen.add(method)
    return traces


SMALLEST_DRAWN = 1e-4
