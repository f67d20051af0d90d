"""Pictures: which there are, that they are small and the same twice, and what they show."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pipeline.reporting.clouds import Example, choose_examples
from pipeline.reporting.pictures import draw_pair, draw_pictures, embedded, project
from pipeline.reporting.reading import read_answers, read_pair_files
from tests.pipeline.reporting.synthetic_results import EVERY_METHOD, write_everything

SCENARIOS = ("modelnet40-unseen_objects", "modelnet40-partial", "kitti")
BLUE, ORANGE, GREEN = (0, 114, 178), (230, 159, 0), (0, 158, 115)


@pytest.fixture(scope="module")
def examples(tmp_path_factory: pytest.TempPathFactory) -> list[Example]:
    folder: Path = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, SCENARIOS, 9, EVERY_METHOD)
    files = read_pair_files(folder / "pairs", SCENARIOS)
    return choose_examples(read_answers(folder / "results"), files)


def pixels(picture: bytes) -> np.ndarray:
    """Height by width by RGB."""
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=int)


def share(image: np.ndarray, color: tuple[int, int, int]) -> float:
    """The share of pixels that are nearly of a colour."""
    return float((np.abs(image - color).max(axis=-1) < 30).mean())


def test_pictures_are_there_small_as_wide_as_a_screen_and_the_same_twice(
    examples: list[Example],
) -> None:
    pictures = draw_pictures(examples)
    assert sorted(pictures) == [
        "pair_kitti.png", "pair_modelnet40.png", "panels_kitti.png", "panels_modelnet40.png"
    ]  # fmt: skip
    assert all(len(content) < 400_000 for content in pictures.values())
    assert all(len(pictures[name]) < 30_000 for name in pictures if name.startswith("pair"))
    assert max(pixels(content).shape[1] for content in pictures.values()) <= 1366
    assert pictures == draw_pictures(examples)


def test_what_there_is_nothing_of_is_not_drawn(examples: list[Example]) -> None:
    only = [example for example in examples if example.dataset == "kitti"]
    assert sorted(draw_pictures(only)) == ["pair_kitti.png", "panels_kitti.png"]
    assert draw_pictures([]) == {}


def test_a_pair_is_blue_before_and_green_after(examples: list[Example]) -> None:
    image = pixels(draw_pair(examples[1]))
    before, after = np.split(image, 2, axis=1)
    assert share(before, BLUE) > 2e-3
    assert share(before, ORANGE) > 2e-3
    assert share(after, GREEN) > 2e-3
    assert share(before, GREEN) == share(after, BLUE) == 0


def test_another_answer_is_another_picture(examples: list[Example]) -> None:
    median = examples[1]
    other = replace(median, answers=median.answers[median.answers["method"] == "identity"])
    assert draw_pair(median) != draw_pair(other)


def test_a_picture_is_held_by_its_address() -> None:
    assert embedded(b"PNG") == "data:image/png;base64,UE5H"


def test_a_projection_keeps_lengths_and_puts_up_above() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    seen = project(points, 0.5)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), np.linalg.norm(points, axis=1))
    assert project(np.array([[0.0, 0, 1]]), 0.5)[0, 1] > 0
