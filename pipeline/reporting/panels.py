"""The paper's qualitative figures: the same pair, as every method registered it."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.reporting.canvas import WIDTH, png
from pipeline.reporting.figures import BLUE, GREEN, INK, ORANGE
from pipeline.reporting.overlays import Cloud, Overlay, Registered, thin
from pipeline.reporting.paper import method_rank, shown
from pipeline.reporting.views import show_bound

POINTS = 350
SIZES = (2.5, 1.6)
"""Of a dot of the target, and of one of what is laid upon it, in points."""
COLUMNS = 7
TILE_HEIGHT, NAME_HEIGHT, HEAD_HEIGHT = 1.2, 0.32, 0.36
"""Of a tile, of the two lines above it, and of a block's heading, in inches."""
ELEVATION_DEG = {"kitti": 55.0}
"""Of the eye above the ground; a street is seen from higher up than the others."""
AZIMUTH_DEG = 45.0
LEGEND = (
    "Blue: source; orange: target; green: source as registered. Under each method its ERROR(R) on"
    " this pair, in degrees."
)


def draw_panel(overlay: Overlay) -> bytes:
    """Draw a data set's pairs one below the other; in each, the pair first, then every method."""
    rows = -(-(len(overlay.registered) + 1) // COLUMNS)
    block_height = HEAD_HEIGHT + rows * (TILE_HEIGHT + NAME_HEIGHT)
    height = len(overlay.choices) * block_height + HEAD_HEIGHT
    figure = Figure(figsize=(WIDTH, height))
    figure.text(0.01, 1 - 0.1 / height, LEGEND, fontsize=9, va="top", color=INK)
    for number, (choice, block) in enumerate(overlay.choices.items()):
        top = height - HEAD_HEIGHT - number * block_height
        chooser = shown(block.registered[0].method).name
        heading = (
            f"{block.title}: the {choice} pair of {chooser} (test pair {block.pair}, {block.group})"
        )
        figure.text(0.01, top / height, heading, fontsize=10, va="top", weight="bold")
        _draw_block(figure, block, top - 0.6 * HEAD_HEIGHT)
    return png(figure)


def _draw_block(figure: Figure, block: Overlay, top: float) -> None:
    height = figure.get_figheight()
    target = (thin(block.target, POINTS), ORANGE)
    pair = [target, (thin(block.source, POINTS), BLUE)]
    ordered = sorted(block.registered, key=lambda one: method_rank(one.method))
    tiles = [
        ("source and target", pair),
        *((_named(one), [target, (thin(one.points, POINTS), GREEN)]) for one in ordered),
    ]
    dataset = block.facts.scenario.partition("-")[0]
    for index, (name, clouds) in enumerate(tiles):
        row, column = divmod(index, COLUMNS)
        bottom = top - row * (TILE_HEIGHT + NAME_HEIGHT) - NAME_HEIGHT - TILE_HEIGHT
        ax = figure.add_axes((column / COLUMNS, bottom / height, 1 / COLUMNS, TILE_HEIGHT / height))
        ax.set_title(name, fontsize=8, pad=1, linespacing=1.05)
        _draw_clouds(ax, clouds, pair if index == 0 else pair[:1], dataset)


def _named(registered: Registered) -> str:
    error = "failed" if registered.failed else f"{show_bound(registered.error_r_deg)}°"
    return f"{shown(registered.method).name}\n{error}"


def _draw_clouds(
    ax: Axes,
    clouds: Sequence[tuple[Cloud, str]],
    framed: Sequence[tuple[Cloud, str]],
    dataset: str,
) -> None:
    """Draw clouds as seen from the eye; the frame fits some of them, whatever falls outside."""
    elevation = np.radians(ELEVATION_DEG.get(dataset, 28.0))
    frame = np.concatenate([project(cloud, elevation)[:, :2] for cloud, _ in framed])
    low, high = frame.min(axis=0), frame.max(axis=0)
    wide = (WIDTH / COLUMNS) / TILE_HEIGHT
    half = 0.56 * max(high[1] - low[1], (high[0] - low[0]) / wide)
    middle = (low + high) / 2
    for size, (cloud, color) in zip(SIZES, clouds, strict=True):
        x, y, _ = project(cloud, elevation).T
        ax.plot(x, y, "o", color=color, ms=size, mew=0)
    ax.set_xlim(middle[0] - half * wide, middle[0] + half * wide)
    ax.set_ylim(middle[1] - half, middle[1] + half)
    ax.set_axis_off()


def project(cloud: Cloud, elevation: float) -> Float64[np.ndarray, "points 3"]:
    """Give what lies right of, above and towards an eye at ``elevation`` [rad] at infinity."""
    azimuth = np.radians(AZIMUTH_DEG)
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                    np.sin(elevation)])  # fmt: skip
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.asarray(cloud @ np.stack([right, np.cross(eye, right), eye], axis=-1))
