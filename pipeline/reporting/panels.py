"""The paper's qualitative figures: the same pair, as every method registered it."""

from collections.abc import Iterator, Sequence

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
TILE = (WIDTH / COLUMNS, 1.2)
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


def draw_panel(overlay: Overlay) -> bytes:
    """Draw a data set's pairs one below the other; in each, the pair first, then every method."""
    rows = -(-(len(overlay.registered) + 1) // COLUMNS)
    block_height = HEAD_HEIGHT + rows * (TILE[1] + NAME_HEIGHT)
    height = len(overlay.choices) * block_height + HEAD_HEIGHT
    figure = Figure(figsize=(WIDTH, height))
    ax = figure.add_axes((0, 0, 1, 1))  # one panel for all tiles, measured in inches
    ax.set(xlim=(0, WIDTH), ylim=(0, height))
    ax.set_axis_off()
    ax.text(0.12, height - 0.1, LEGEND, fontsize=9, va="top", color=INK)
    for number, (choice, block) in enumerate(overlay.choices.items()):
        top = height - HEAD_HEIGHT - number * block_height
        chooser = shown(block.registered[0].method).name
        heading = (
            f"{block.title}: the {choice} pair of {chooser} (test pair {block.pair}, {block.group})"
        )
        ax.text(0.12, top, heading, fontsize=10, va="top", weight="bold")
        _draw_block(ax, block, top - 0.6 * HEAD_HEIGHT)
    return png(figure)


def _draw_block(ax: Axes, block: Overlay, top: float) -> None:
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
        left, bottom = column * TILE[0], top - (row + 1) * (TILE[1] + NAME_HEIGHT)
        middle = left + TILE[0] / 2, bottom + TILE[1]
        ax.text(*middle, name, fontsize=8, ha="center", va="bottom", linespacing=1.05)
        seen = _seen(clouds, pair if index == 0 else pair[:1], dataset)
        for size, (points, color) in zip(SIZES, seen, strict=True):
            ax.plot(left + points[:, 0], bottom + points[:, 1], "o", color=color, ms=size, mew=0)


def _named(registered: Registered) -> str:
    error = "failed" if registered.failed else f"{show_bound(registered.error_r_deg)}°"
    return f"{shown(registered.method).name}\n{error}"


def _seen(
    clouds: Sequence[tuple[Cloud, str]], framed: Sequence[tuple[Cloud, str]], dataset: str
) -> Iterator[tuple[Float64[np.ndarray, "points 2"], str]]:
    """Give where in its tile the eye sees each cloud; some fit it, and what falls outside is cut."""
    elevation = np.radians(ELEVATION_DEG.get(dataset, 28.0))
    frame = np.concatenate([project(cloud, elevation)[:, :2] for cloud, _ in framed])
    low, high = frame.min(axis=0), frame.max(axis=0)
    scale = 1 / (1.12 * ((high - low) / TILE).max())
    for cloud, color in clouds:
        at = scale * (project(cloud, elevation)[:, :2] - (low + high) / 2) + np.divide(TILE, 2)
        yield at[((at >= 0) & (at <= TILE)).all(axis=1)], color


def project(cloud: Cloud, elevation: float) -> Float64[np.ndarray, "points 3"]:
    """Give what lies right of, above and towards an eye at ``elevation`` [rad] at infinity."""
    azimuth = np.radians(AZIMUTH_DEG)
    eye = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth),
                    np.sin(elevation)])  # fmt: skip
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.asarray(cloud @ np.stack([right, np.cross(eye, right), eye], axis=-1))
