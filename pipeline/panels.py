"""The paper's qualitative figures: the same pair, as every method registered it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.background import read_test_pair
from pipeline.canvas import WIDTH, png
from pipeline.figures import BLUE, GREEN, INK, ORANGE
from pipeline.overlays import Cloud, move, thin
from pipeline.paper import method_rank, place, scenario_rank, shown
from pipeline.result_files import Scores, headlines
from pipeline.views import show_bound

CHOOSER = "pcrdiffusion_cb"
"""Whose rotation errors choose the pairs; where it was not run, the last method's do."""
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


@dataclass(frozen=True)
class Tile:
    """The source cloud where one method put it."""

    method: str
    points: Cloud
    error_r_deg: float
    failed: bool


@dataclass(frozen=True)
class Block:
    """One pair, and what all methods made of it."""

    rank: str
    """``best``, ``median`` or ``worst`` of the method that chose it."""
    chooser: str
    pair: int
    group: str
    source: Cloud
    target: Cloud
    tiles: tuple[Tile, ...]


@dataclass(frozen=True)
class Panel:
    """Three pairs of the first scenario of one data set."""

    dataset: str
    scenario: str
    blocks: tuple[Block, ...]


def read_panels(scores: Sequence[Scores], pairs: Path) -> list[Panel]:
    """Read, for each data set, the best, the median and the worst pair of its first scenario.

    Raises:
        FileNotFoundError: There is no pair file.
        ValueError: It lacks one of the pairs.
    """
    first: dict[str, str] = {}
    for scenario in sorted({one.scenario for one in scores}, key=scenario_rank):
        first.setdefault(scenario.partition("-")[0], scenario)
    return [_read_panel(scores, pairs, *place) for place in first.items()]


def chosen_pairs(scores: Scores) -> dict[str, int]:
    """Find the pairs of least, (lower) median and greatest rotation error; the first of equals."""
    order = np.argsort(scores.numbers["error_r_deg"], kind="stable")
    places = {"best": 0, "median": (len(order) - 1) // 2, "worst": len(order) - 1}
    return {rank: int(scores.pair[order[at]]) for rank, at in places.items()}


def _read_panel(scores: Sequence[Scores], pairs: Path, dataset: str, scenario: str) -> Panel:
    main = [one for (where, _), one in headlines(scores).items() if where == scenario]
    ordered = sorted(main, key=lambda one: method_rank(one.method))
    chooser = next((one for one in ordered if one.method == CHOOSER), ordered[-1])
    blocks = []
    for rank, pair in chosen_pairs(chooser).items():
        source, target = read_test_pair(pairs, scenario, pair)
        few = thin(source, POINTS)
        row = chooser.pair.tolist().index(pair)
        blocks.append(
            Block(
                rank=rank,
                chooser=chooser.method,
                pair=pair,
                group=chooser.group[row],
                source=few,
                target=thin(target, POINTS),
                tiles=tuple(_tile(one, pair, few) for one in ordered),
            )
        )
    return Panel(dataset, scenario, tuple(blocks))


def _tile(scores: Scores, pair: int, source: Cloud) -> Tile:
    row = scores.pair.tolist().index(pair)
    return Tile(
        method=scores.method,
        points=move(scores.T_target_source()[row], source),
        error_r_deg=float(scores.numbers["error_r_deg"][row]),
        failed=bool(scores.failed[row]),
    )


def draw_panel(panel: Panel) -> bytes:
    """Draw the blocks one below the other; in each, the pair first, then a tile a method."""
    rows = -(-(len(panel.blocks[0].tiles) + 1) // COLUMNS)
    block_height = HEAD_HEIGHT + rows * (TILE_HEIGHT + NAME_HEIGHT)
    height = len(panel.blocks) * block_height + HEAD_HEIGHT
    figure = Figure(figsize=(WIDTH, height))
    figure.text(0.01, 1 - 0.1 / height, LEGEND, fontsize=9, va="top", color=INK)
    for number, block in enumerate(panel.blocks):
        top = height - HEAD_HEIGHT - number * block_height
        figure.text(
            0.01, top / height, _heading(panel, block), fontsize=10, va="top", weight="bold"
        )
        _draw_block(figure, block, panel.dataset, top - 0.6 * HEAD_HEIGHT)
    return png(figure)


def _heading(panel: Panel, block: Block) -> str:
    return (
        f"{place(panel.scenario).title}: the {block.rank} pair of {shown(block.chooser).name}"
        f" (test pair {block.pair}, {block.group})"
    )


def _draw_block(figure: Figure, block: Block, dataset: str, top: float) -> None:
    height = figure.get_figheight()
    pair = [(block.target, ORANGE), (block.source, BLUE)]
    shown_tiles = [
        ("source and target", "", pair),
        *(
            (
                shown(tile.method).name,
                "failed" if tile.failed else f"{show_bound(tile.error_r_deg)}°",
                [(block.target, ORANGE), (tile.points, GREEN)],
            )
            for tile in block.tiles
        ),
    ]
    for index, (name, error, clouds) in enumerate(shown_tiles):
        row, column = divmod(index, COLUMNS)
        bottom = top - row * (TILE_HEIGHT + NAME_HEIGHT) - NAME_HEIGHT - TILE_HEIGHT
        where = (column / COLUMNS, bottom / height, 1 / COLUMNS, TILE_HEIGHT / height)
        ax = figure.add_axes(where)
        ax.set_title(f"{name}\n{error}" if error else name, fontsize=8, pad=1, linespacing=1.05)
        _draw_clouds(ax, clouds, pair if index == 0 else pair[:1], dataset)


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
