"""The PNG pictures of clouds: a pair before and after, and the pairs as every method put them."""

import base64
import io
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from pipeline.reporting.clouds import Cloud, Example, thin
from pipeline.reporting.drawing import BLUE, GREEN, INK, ORANGE, ranks
from pipeline.reporting.paper import shown
from pipeline.reporting.showing import show_bound

DPI = 110
WIDTH = 12.4
"""Of a panel of all methods, in inches: 1364 pixels, the width of a laptop's screen."""
COLUMNS = 7
TILE = (WIDTH / COLUMNS, 1.2)
PAIR_TILE = (2.2, 1.9)
"""Width and height of a tile, in inches."""
NAME_HEIGHT, HEAD_HEIGHT = 0.32, 0.36
"""Of the two lines above a tile, and of a block's heading, in inches."""
ELEVATION_DEG = {"kitti": 55.0}
"""Of the eye above the ground; a street is seen from higher up than the others."""
AZIMUTH_DEG = 45.0
LEGEND = (
    "Blue: source; orange: target; green: source as registered. Under each method its ERROR(R) on"
    " this pair, in degrees."
)
Colored = Sequence[tuple[Cloud, str]]


def draw_pictures(examples: Sequence[Example]) -> dict[str, bytes]:
    """Draw two pictures of each data set, as PNG bytes by file name: same pairs, same bytes."""
    pictures = {}
    for dataset in dict.fromkeys(example.dataset for example in examples):
        mine = [example for example in examples if example.dataset == dataset]
        median = next(example for example in mine if example.choice == "median")
        pictures[f"pair_{dataset}.png"] = draw_pair(median)
        pictures[f"panels_{dataset}.png"] = draw_panels(mine)
    return pictures


def embedded(picture: bytes) -> str:
    """Write a PNG picture as an address that holds it."""
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"


def draw_pair(example: Example) -> bytes:
    """Draw a pair before registration, at the left, and after it by the method that chose it."""
    figure, ax = _canvas(2 * PAIR_TILE[0], PAIR_TILE[1])
    target = (thin(example.target, 900), ORANGE)
    answer = example.answers.iloc[0].to_dict()
    tiles = {
        "before": [target, (thin(example.source, 900), BLUE)],
        "after": [target, (thin(example.registered(answer), 900), GREEN)],
    }
    for column, (name, clouds) in enumerate(tiles.items()):
        left = column * PAIR_TILE[0]
        ax.text(left + 0.1, PAIR_TILE[1] - 0.08, name, fontsize=9, va="top", color=INK)
        _draw_tile(ax, clouds, clouds, (left, 0.0), PAIR_TILE, example.dataset)
    return png(figure)


def draw_panels(examples: Sequence[Example]) -> bytes:
    """Draw pairs one below the other; in each, the pair first, then every method."""
    rows = -(-(len(examples[0].answers) + 1) // COLUMNS)
    block_height = HEAD_HEIGHT + rows * (TILE[1] + NAME_HEIGHT)
    height = len(examples) * block_height + HEAD_HEIGHT
    figure, ax = _canvas(WIDTH, height)
    ax.text(0.12, height - 0.1, LEGEND, fontsize=9, va="top", color=INK)
    for number, example in enumerate(examples):
        top = height - HEAD_HEIGHT - number * block_height
        chooser = shown(example.answers["method"].iloc[0]).name
        heading = f"{example.title}: the {example.choice} pair of {chooser}"
        heading += f" (test pair {example.pair}, {example.group})"
        ax.text(0.12, top, heading, fontsize=10, va="top", weight="bold")
        _draw_block(ax, example, top - 0.6 * HEAD_HEIGHT)
    return png(figure)


def _canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Make one panel for all tiles, measured in inches."""
    figure = Figure(figsize=(width, height))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, width), ylim=(0, height))
    ax.set_axis_off()
    return figure, ax


def _draw_block(ax: Axes, example: Example, top: float) -> None:
    target = (thin(example.target, 350), ORANGE)
    pair = [target, (thin(example.source, 350), BLUE)]
    tiles = [("source and target", pair, pair)]
    for answer in example.answers.sort_values("method", key=ranks).to_dict("records"):
        error = (
            "failed" if answer["failed"] else show_bound("error_deg", answer["error_r_deg"]) + "°"
        )
        registered = (thin(example.registered(answer), 350), GREEN)
        tiles.append((f"{shown(answer['method']).name}\n{error}", [target, registered], [target]))
    for index, (name, clouds, framed) in enumerate(tiles):
        row, column = divmod(index, COLUMNS)
        corner = column * TILE[0], top - (row + 1) * (TILE[1] + NAME_HEIGHT)
        middle = corner[0] + TILE[0] / 2, corner[1] + TILE[1]
        ax.text(*middle, name, fontsize=8, ha="center", va="bottom", linespacing=1.05)
        _draw_tile(ax, clouds, framed, corner, TILE, example.dataset)


def _draw_tile(
    ax: Axes, clouds: Colored, framed: Colored, corner: tuple[float, float],
    size: tuple[float, float], dataset: str,
) -> None:  # fmt: skip
    """Draw clouds as the eye sees them; ``framed`` fit the tile, and what falls outside is cut."""
    elevation = np.radians(ELEVATION_DEG.get(dataset, 28.0))
    frame = np.concatenate([project(cloud, elevation)[:, :2] for cloud, _ in framed])
    low, high = np.percentile(frame, [1, 99], axis=0)
    scale = 1 / (1.12 * ((high - low) / size).max())
    for dot, (cloud, color) in zip((2.5, 1.6), clouds, strict=True):
        at = scale * (project(cloud, elevation)[:, :2] - (low + high) / 2) + np.divide(size, 2)
        at = at[((at >= 0) & (at <= size)).all(axis=1)] + corner
        ax.plot(at[:, 0], at[:, 1], "o", color=color, ms=dot, mew=0)


def project(cloud: Cloud, elevation: float) -> Float64[np.ndarray, "points 3"]:
    """Give what lies right of, above and towards an eye at ``elevation`` [rad] at infinity."""
    azimuth = np.radians(AZIMUTH_DEG)
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                    np.sin(elevation)])  # fmt: skip
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.asarray(cloud @ np.stack([right, np.cross(eye, right), eye], axis=-1))


def png(figure: Figure) -> bytes:
    """Render in 256 colours, without a date or a version: the same figure, the same bytes."""
    figure.set_dpi(DPI)
    canvas, small = FigureCanvasAgg(figure), io.BytesIO()
    drawn, size = canvas.print_to_buffer()  # type: ignore[no-untyped-call]  # has no annotations
    image = Image.frombytes("RGBA", size, drawn).convert("RGB")
    image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(small, "png")
    return small.getvalue()
