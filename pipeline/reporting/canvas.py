"""What the PNG pictures share: their bytes, their panels, and how each method is drawn."""

import io
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from PIL import Image

from pipeline.reporting.figures import GREEN, GREY, GRID, INK, ORANGE, RED, method_color
from pipeline.reporting.paper import METHODS, method_rank, shown

DPI = 110
WIDTH = 12.4
"""In inches: 1364 pixels, the width of a laptop's screen."""
COLUMNS = 3
LEGEND = 2.0
"""In inches: room for the names of the methods."""
CLASSICAL = (INK, RED, ORANGE, GREEN, "#56B4E9", "#CC79A7", GREY)
DASHES = {"learned": "-", "classical": "--", "floor": ":"}


def line_style(method: str) -> dict[str, Any]:
    """Say how a method's line looks, the same in every picture: colour, dashes, width."""
    kind = shown(method).kind
    if kind == "learned":
        width = 2.6 if method.startswith("pcrdiffusion") else 1.3
        return {"color": method_color(method), "ls": DASHES[kind], "lw": width}
    same = [name for name, entry in METHODS.items() if entry.kind == kind]
    color = CLASSICAL[same.index(method) % len(CLASSICAL)]
    return {"color": color, "ls": DASHES[kind], "lw": 1.3 if kind == "classical" else 1.8}


def method_legend(figure: Figure, methods: Sequence[str]) -> None:
    """Name the lines of all panels, in the room ``LEGEND`` at the right of them."""
    ordered = sorted(methods, key=method_rank)
    lines = [Line2D([], [], **line_style(method)) for method in ordered]
    names = [shown(method).name for method in ordered]
    figure.legend(lines, names, loc="upper right", fontsize=8, frameon=False)


def grid_of_panels(
    count: int,
    height: float,
    *,
    columns: int = COLUMNS,
    labels: float = 0.75,
    left: float = 0.0,
    legend: float = 0.0,
) -> tuple[Figure, list[Axes]]:
    """Make a figure of so many panels; all lengths are in inches.

    Args:
        count: How many.
        height: Of a panel with its title and labels.
        columns: Panels side by side.
        labels: Room left of each panel for its labels.
        left: Room left of all panels.
        legend: Room right of all panels.
    """
    columns = min(columns, count)
    total = -(-count // columns) * height
    width = (WIDTH - left - legend) / columns
    figure = Figure(figsize=(WIDTH, total))
    size = (width - labels - 0.15) / WIDTH, (height - 0.9) / total
    places = [
        ((left + column * width + labels) / WIDTH, 1 - ((row + 1) * height - 0.55) / total)
        for row, column in (divmod(index, columns) for index in range(count))
    ]
    return figure, [figure.add_axes((*place, *size)) for place in places]


def dress(ax: Axes, title: str, x: str, y: str) -> None:
    """Give a panel its title, the names of its axes, and a grid."""
    ax.set_title(title, fontsize=9, loc="left", fontweight="bold")
    ax.set_xlabel(x, fontsize=9)
    ax.set_ylabel(y, fontsize=9)
    ax.tick_params(labelsize=8)
    ax.grid(color=GRID, lw=0.8)
    ax.set_axisbelow(True)


def plain_numbers(ax: Axes, axes: str) -> None:
    """Write the numbers of drawn logarithmic axes (``x``, ``y`` or both) without powers."""
    for name in axes:
        one = ax.xaxis if name == "x" else ax.yaxis
        low, high = sorted(ax.get_xlim() if name == "x" else ax.get_ylim())
        if high < 100 * low:  # too few powers of ten to read values by
            one.set_major_locator(LogLocator(subs=(1, 2, 5)))
        one.set_major_formatter(FuncFormatter(_plain))
        one.set_minor_locator(NullLocator())  # hundreds of ticks, most of the time a chart takes


def _plain(value: float, _: object) -> str:
    return f"{value:g}"


def png(figure: Figure) -> bytes:
    """Render in 256 colours, without a date or a version: the same figure, the same bytes."""
    figure.set_dpi(DPI)
    canvas, small = FigureCanvasAgg(figure), io.BytesIO()
    drawn, size = canvas.print_to_buffer()  # type: ignore[no-untyped-call]  # has no annotations
    image = Image.frombytes("RGBA", size, drawn).convert("RGB")
    image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(small, "png")
    return small.getvalue()
