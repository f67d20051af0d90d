"""The PNG charts of how errors are spread, what they cost, and what they depend on."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from pipeline.reporting.canvas import (
    LEGEND,
    dress,
    grid_of_panels,
    line_style,
    method_legend,
    plain_numbers,
    png,
)
from pipeline.reporting.difficulty import OVERLAP, PARTIAL, ROTATION
from pipeline.reporting.figures import BLUE, GREY, INK, KINDS, RED, method_color
from pipeline.reporting.paper import (
    ABLATIONS,
    BOUND,
    TIMING,
    UNSEEN_OBJECTS,
    method_rank,
    place,
    scenario_rank,
    shown,
)
from pipeline.reporting.result_files import Scores, headlines
from pipeline.reporting.tables import Row
from pipeline.reporting.views import main_rows, natural, setting_rank

LEAST_DEG = 1e-3
EDGE = f"{LEAST_DEG:g} or less at the edge"
"""Smaller errors are drawn as if they were so large: the axis is logarithmic."""
SAMPLERS = {"ddpm": ("-", "o", BLUE), "ddim": ("--", "s", RED)}
"""Dashes, mark and colour."""
LABELLED = np.array([4.45, 4.7])
"""Inches of a panel whose points have names."""
LETTER = 0.062
"""Of a name's width, in inches."""
HEIGHTS = [sign * 0.15 * k for k in range(9) for sign in (1, -1)]
"""Where a name may be above its point, in inches: the nearest first."""


def draw_distributions(scores: Sequence[Scores]) -> bytes:
    """Draw the share of pairs below each ERROR(R), a panel a scenario, a line a method."""
    main = headlines(scores)
    scenarios = sorted({scenario for scenario, _ in main}, key=scenario_rank)
    figure, axes = grid_of_panels(len(scenarios), 3.2, legend=LEGEND)
    for ax, scenario in zip(axes, scenarios, strict=True):
        for method in sorted((m for s, m in main if s == scenario), key=method_rank):
            errors = np.sort(main[scenario, method].numbers["error_r_deg"]).clip(LEAST_DEG)
            share = 100 * np.arange(1, len(errors) + 1) / len(errors)
            ax.step([LEAST_DEG, *errors, 180], [0, *share, 100], where="post", **line_style(method))
        ax.set_xscale("log")
        ax.set_xlim(LEAST_DEG, 180)
        ax.set_ylim(0, 102)
        plain_numbers(ax, "x")
        dress(ax, place(scenario).title, f"ERROR(R) [deg], {EDGE}", "pairs below [%]")
    method_legend(figure, [*{method for _, method in main}])
    return png(figure)


def draw_accuracy_time(rows: Sequence[Row]) -> bytes:
    """Draw ERROR(R) against seconds: ours at the left, the paper's at the right."""
    at = {
        (row.method, row.setting, row.metric): row
        for row in rows
        if (row.table, row.kind) == (TIMING.table, "line")
    }
    points = [
        (seconds, at[method, setting, "error_r_deg"])
        for (method, setting, metric), seconds in at.items()
        if metric == "seconds" and (method, setting, "error_r_deg") in at
    ]
    figure, (ours, theirs) = grid_of_panels(2, 5.6, columns=2, legend=1.7)
    for seconds, error in points:
        _draw_cost(ours, seconds, error)
    printed = [
        Named(seconds.paper, (seconds.paper,) * 2, error.paper, shown(error.method).name)
        for seconds, error in points
        if error.setting == "paper" and seconds.paper and error.paper and seconds.paper > BOUND
    ]
    for one in printed:
        theirs.plot([one.x], [one.y], "D", color=INK, mfc="none", ms=7)
    named = [Named(s.value, (s.low, s.high), max(e.value, LEAST_DEG), _name(e)) for s, e in points]
    title = "printed in the paper (CF is printed as below 1e-10 s)"
    for ax, text, labels in ((ours, "ours", named), (theirs, title, printed)):
        ax.set_xscale("log")
        ax.set_yscale("log")
        dress(ax, text, "time a pair [s]", "ERROR(R) [deg], ModelNet40, unseen objects")
        _label(ax, labels)
        plain_numbers(ax, "xy")
    marks = [
        *(Line2D([], [], color=color, marker="o", ls="") for color in KINDS.values()),
        Line2D([], [], color=INK, marker="o", mfc="white", ls=""),
    ]
    names = [*KINDS, "authors' own settings"]
    figure.legend(marks, names, loc="upper right", fontsize=8, frameon=False)
    return png(figure)


def _name(row: Row) -> str:
    return shown(row.method).name + ("" if row.setting == "paper" else f" ({row.setting})")


def _draw_cost(ax: Axes, seconds: Row, error: Row) -> None:
    low, y, high = (max(number, LEAST_DEG) for number in (error.low, error.value, error.high))
    color = KINDS[shown(error.method).kind]
    ax.plot([seconds.low, seconds.high], [y, y], color=color, lw=1.2)
    ax.plot([seconds.value] * 2, [low, high], color=color, lw=1.2)
    inside = color if error.setting == "paper" else "white"
    mark = "o" if error.value >= LEAST_DEG else "v"
    ax.plot([seconds.value], [y], mark, color=color, mfc=inside, ms=7)


class Named(NamedTuple):
    """A point of a logarithmic panel, how far its bar reaches across, and its name."""

    x: float
    reach: tuple[float, float]
    y: float
    name: str


def _label(ax: Axes, points: Sequence[Named]) -> None:
    """Name points, each beside its own and off all points and other names."""
    if not points:
        return
    where = np.log10([(one.x, one.y) for one in points])
    low, high = where.min(axis=0), where.max(axis=0)
    low, high = low - 0.12 * (high - low) - 0.1, high + 0.15 * (high - low) + 0.1
    ax.set_xlim(*10 ** np.array([low[0], high[0]]))
    ax.set_ylim(*10 ** np.array([low[1], high[1]]))
    inches = (where - low) / (high - low) * LABELLED
    bars = (np.log10([one.reach for one in points]) - low[0]) / (high - low)[0] * LABELLED[0]
    bars = bars + np.array([-0.07, 0.07])
    taken = [
        (left, y - 0.06, right, y + 0.06)
        for (left, right), (_, y) in zip(bars, inches, strict=True)
    ]
    for one, (x, y), (left, right) in zip(points, inches, bars, strict=True):
        wide = LETTER * len(one.name)
        starts = [(begin, y + up) for up in HEIGHTS for begin in (right, left - wide, x - wide / 2)]
        boxes = [(begin, at - 0.07, begin + wide, at + 0.07) for begin, at in starts]
        inside = [box for box in boxes if box[0] > 0 and box[2] < LABELLED[0]]
        free = (box for box in inside if not any(_meet(box, other) for other in taken))
        box = next(free, boxes[0])
        taken.append(box)
        up = box[1] + 0.07 - y
        line = {"arrowstyle": "-", "color": GREY, "lw": 0.6, "shrinkA": 0, "shrinkB": 3}
        ax.annotate(
            one.name, (one.x, one.y), (72 * (box[0] - x), 72 * up), textcoords="offset points",
            fontsize=8, va="center", arrowprops=line if abs(up) > 0.1 else None,
        )  # fmt: skip


def _meet(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def draw_difficulty(rows: Sequence[Row]) -> bytes:
    """Draw ERROR(R) against the true angle, the overlap, and the noise; only what there is."""
    panels = {
        f"{ROTATION}=": (UNSEEN_OBJECTS, "true rotation [deg]"),
        f"{OVERLAP}=": (PARTIAL, "overlap: share of source points"),
        "noise=": (UNSEEN_OBJECTS, "deviation of the noise [unit sphere]"),
    }
    found = {
        start: [
            row
            for row in rows
            if (row.scenario, row.subset, row.metric) == (scenario, "all", "error_r_deg")
            and row.kind in ("bin", "line")
            and row.setting.startswith(start)
        ]
        for start, (scenario, _) in panels.items()
    }
    there = [start for start in panels if found[start]]
    figure, axes = grid_of_panels(len(there), 4.6, legend=LEGEND)
    for ax, start in zip(axes, there, strict=True):
        scenario, label = panels[start]
        _draw_dependence(ax, found[start])
        ax.set_yscale("log")
        plain_numbers(ax, "y")
        title = "ModelNet40, noise added" if start == "noise=" else place(scenario).title
        dress(ax, title, label, f"ERROR(R) [deg], {EDGE}")
    method_legend(figure, [*{row.method for here in found.values() for row in here}])
    return png(figure)


def _draw_dependence(ax: Axes, rows: Sequence[Row]) -> None:
    """Draw a line a method, with the intervals of CF and CB."""
    for method in sorted({row.method for row in rows}, key=method_rank):
        here = sorted((row for row in rows if row.method == method), key=lambda row: _middle(row))
        x = [_middle(row) for row in here]
        low, y, high = (
            np.maximum([getattr(row, name) for row in here], LEAST_DEG)
            for name in ("low", "value", "high")
        )
        style = line_style(method)
        ax.plot(x, y, marker=".", ms=5, **style)
        if method.startswith("pcrdiffusion"):
            ax.fill_between(x, low, high, color=style["color"], alpha=0.18, lw=0)


def _middle(row: Row) -> float:
    """Where a row stands: the middle of its bin, or the value that was varied."""
    numbers = row.setting.partition("=")[2].split("-")
    return sum(map(float, numbers)) / len(numbers)


def draw_steps(rows: Sequence[Row]) -> bytes:
    """Draw ERROR(R) against sampling steps, a panel a method: intervals, draws, the paper's."""
    here = [
        row
        for row in rows
        if (row.table, row.subset, row.metric) == (ABLATIONS["steps"].table, "all", "error_r_deg")
        and row.kind in ("line", "draw")
    ]
    methods = sorted({row.method for row in here}, key=method_rank)
    figure, axes = grid_of_panels(len(methods), 3.8, columns=2)
    for ax, method in zip(axes, methods, strict=True):
        mine = [row for row in here if row.method == method]
        for shift, sampler in zip((0.97, 1.03), SAMPLERS, strict=True):
            _draw_sampler(ax, [row for row in mine if sampler in row.setting], sampler, shift)
        printed = [(_num_steps(row), row.paper) for row in mine if row.paper is not None]
        if printed:
            x, y = zip(*sorted(printed), strict=True)
            ax.plot(x, y, "D-", color=INK, mfc="none", ms=7, lw=1, label="printed in the paper")
        ticks = sorted({_num_steps(row) for row in mine})
        ax.set_xscale("log", base=2)
        ax.set_xticks(ticks, [str(tick) for tick in ticks])
        ax.set_ylim(bottom=0)
        ax.legend(fontsize=8, frameon=False, loc="lower right")
        dress(ax, shown(method).name, "sampling steps", "ERROR(R) [deg]")
    return png(figure)


def _draw_sampler(ax: Axes, rows: Sequence[Row], sampler: str, shift: float) -> None:
    """Draw one sampler: the first draw with its interval over pairs, further draws as strokes."""
    lines = sorted(
        (row for row in rows if row.kind == "line"), key=lambda row: natural(row.setting)
    )
    if not lines:
        return
    dashes, mark, color = SAMPLERS[sampler]
    x = [shift * _num_steps(row) for row in lines]
    y = [row.value for row in lines]
    off = [[row.value - row.low for row in lines], [row.high - row.value for row in lines]]
    name = f"{sampler.upper()}, 95 % interval over pairs"
    ax.errorbar(x, y, off, color=color, ls=dashes, marker=mark, ms=5, lw=1.4, capsize=3, label=name)
    draws = [row for row in rows if row.kind == "draw"]
    if draws:
        at = [shift**3 * _num_steps(row) for row in draws]
        label = f"{sampler.upper()}, further draws of the noise"
        ax.plot(at, [row.value for row in draws], "_", color=color, ms=11, mew=1.6, label=label)


def _num_steps(row: Row) -> int:
    return int(row.setting.partition("=")[2].partition(",")[0])


def draw_ablations(rows: Sequence[Row]) -> bytes:
    """Draw Tables 3 to 5: a dot and an interval a setting, and the paper's where it has one."""
    names = ("diffusion", "representation", "fusion")
    found = {
        name: [
            row
            for row in rows
            if (row.table, row.subset, row.metric) == (ABLATIONS[name].table, "all", "error_r_deg")
            and row.kind == "line"
        ]
        for name in names
    }
    there = [name for name in names if found[name]]
    figure, axes = grid_of_panels(len(there), 3.6, columns=2, labels=1.95)
    constant = main_rows(rows, "error_r_deg").get((UNSEEN_OBJECTS, "constant"))
    for ax, name in zip(axes, there, strict=True):
        _draw_settings(ax, found[name])
        if constant:
            ax.axvline(constant.value, color=GREY, lw=1, ls=":", label="constant pose")
        ax.set_xscale("log")
        plain_numbers(ax, "x")
        at = ABLATIONS[name]
        dress(ax, f"Table {at.table}: {at.title.lower()}", "ERROR(R) [deg]", "")
        ax.legend(fontsize=7, frameon=False, loc="best")
    return png(figure)


def _draw_settings(ax: Axes, rows: Sequence[Row]) -> None:
    ordered = sorted(rows, key=lambda row: (method_rank(row.method), setting_rank(row.setting)))
    several = len({row.method for row in rows}) > 1
    for y, row in enumerate(ordered):
        color = method_color(row.method)
        ax.plot([row.low, row.high], [y, y], color=color, lw=1.8)
        ax.plot([row.value], [y], "o", color=color, ms=6, label="ours" if y == 0 else None)
    printed = [(row.paper, y) for y, row in enumerate(ordered) if row.paper is not None]
    if printed:
        x, at = zip(*printed, strict=True)
        ax.plot(x, at, "D", color=INK, mfc="none", ms=6, label="the paper's")
    labels = [
        (f"{shown(row.method).name[-2:]}: " if several else "")
        + ", ".join(part.partition("=")[2] for part in row.setting.split(","))
        for row in ordered
    ]
    ax.set_yticks(range(len(ordered)), labels)
    ax.set_ylim(len(ordered) - 0.4, -0.6)
