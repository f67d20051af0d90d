"""Pictures: which there are, that they are small and the same twice, and what panels show."""

import io
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from pipeline.reporting.background import Training, read_pair_files, read_trainings
from pipeline.reporting.charts import draw_accuracy_time, draw_difficulty
from pipeline.reporting.difficulty import measure_difficulties
from pipeline.reporting.overlays import Overlay, make_overlays
from pipeline.reporting.panels import project
from pipeline.reporting.pictures import draw_all
from pipeline.reporting.result_files import Scores, read_results, read_times
from pipeline.reporting.tables import Row, make_rows
from tests.pipeline.reporting.made_up_results import EVERY_METHOD, write_everything

SCENARIOS = ("modelnet40-unseen_objects", "modelnet40-partial", "kitti")


class Inputs(NamedTuple):
    """What is drawn."""

    rows: list[Row]
    overlays: list[Overlay]
    trainings: list[Training]
    scores: list[Scores]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, SCENARIOS, 9, EVERY_METHOD)
    return folder


@pytest.fixture(scope="module")
def inputs(folder: Path) -> Inputs:
    scores, times = read_results(folder / "results"), read_times(folder / "results")
    files = read_pair_files(folder / "pairs", SCENARIOS)
    rows = make_rows(scores, times, measure_difficulties(files), seed=0)
    trainings = read_trainings(folder / "models")
    return Inputs(rows, make_overlays(scores, files), trainings, scores)


def test_pictures_are_there_small_as_wide_as_a_screen_and_the_same_twice(inputs: Inputs) -> None:
    pictures = draw_all(*inputs)
    assert sorted(pictures) == [
        "ablations.png",
        "accuracy_time.png",
        "curves.png",
        "difficulty.png",
        "distributions.png",
        "errors.png",
        "panels_kitti.png",
        "panels_modelnet40.png",
        "steps.png",
    ]
    assert all(len(content) < 400_000 for content in pictures.values())
    sizes = {name: Image.open(io.BytesIO(content)).size for name, content in pictures.items()}
    assert max(width for width, _ in sizes.values()) <= 1366
    assert pictures == draw_all(*inputs)


def test_what_there_is_nothing_of_is_not_drawn(inputs: Inputs) -> None:
    rows = [row for row in inputs.rows if row.table == "2" and row.kind == "line"]
    only = [one for one in inputs.trainings if one.setting is not None]
    pictures = draw_all(rows, inputs.overlays[1:], only)
    assert sorted(pictures) == ["errors.png", "panels_kitti.png"]


def test_a_projection_keeps_lengths_and_puts_up_above() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    seen = project(points, 0.5)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), np.linalg.norm(points, axis=1))
    assert project(np.array([[0.0, 0, 1]]), 0.5)[0, 1] > 0


def test_charts_are_drawn_of_few_rows_too(inputs: Inputs) -> None:
    noise = [row for row in inputs.rows if row.setting.startswith("noise=")]
    assert draw_difficulty(noise).startswith(b"\x89PNG")
    alone = [row for row in inputs.rows if (row.table, row.method) == ("6", "egst")]
    assert draw_accuracy_time(alone).startswith(b"\x89PNG")  # the paper prints none of its numbers
