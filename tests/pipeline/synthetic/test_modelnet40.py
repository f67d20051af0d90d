"""The synthetic ModelNet40: official tree, same bytes twice, shapes that differ and have one pose."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from jaxtyping import Float64
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from pcrdiff.clouds.surface import Cloud, Mesh, sample_points
from pcrdiff.datasets.modelnet40 import CATEGORIES, SYMMETRIC, read_items
from pipeline.synthetic.modelnet40 import make_shape, write_modelnet40
from pipeline.synthetic.shapes.makers import MAKERS

T = TypeVar("T")
TRAIN, TEST, SEED = 2, 1, 5


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("modelnet40")
    write_modelnet40(folder, train_per_category=TRAIN, test_per_category=TEST, seed=SEED)
    return folder


def shape(category: str, number: int) -> Mesh:
    return make_shape(category, generator=np.random.default_rng([number, len(category)]))


def normalised_sample(mesh: Mesh, count: int, seed: int) -> Cloud:
    """Points in the mesh's bounding box brought to the origin, its longest side to 2."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    points = sample_points(mesh, count, generator=np.random.default_rng(seed))
    return np.asarray((points - (low + high) / 2) / (high - low).max() * 2)


def nearest(cloud: Cloud, points: Cloud) -> Float64[np.ndarray, " points"]:
    """How far each of the points is from a cloud."""
    return np.asarray(KDTree(cloud).query(points)[0])


def distance(a: Cloud, b: Cloud) -> float:
    """How far each point is from the other cloud, on average and both ways."""
    return float(nearest(a, b).mean() + nearest(b, a).mean()) / 2


def relative_distance(first: Mesh, second: Mesh, turn_deg: float = 0) -> float:
    """The distance of two shapes, in units of what two samples of the same shape differ by."""
    turned = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    a, again = (normalised_sample(first, 2000, seed) for seed in (0, 1))
    return distance(a, normalised_sample(second, 2000, 2) @ turned.T) / distance(a, again)


def test_every_category_of_modelnet40_has_a_maker_in_the_official_order() -> None:
    assert tuple(MAKERS) == CATEGORIES


def test_the_tree_is_the_official_one(root: Path) -> None:
    expected = {
        f"{category}/{split}/{category}_{number:04d}.off"
        for category in CATEGORIES
        for split, number in (("train", 1), ("train", 2), ("test", 3))
    }
    found = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}
    assert found == expected


def test_the_files_are_plain_off_files_with_unix_line_ends_and_small(root: Path) -> None:
    for path in sorted(root.rglob("*.off")):
        content = path.read_bytes()
        lines = content.decode("ascii").split("\n")
        vertices, faces, edges = (int(count) for count in lines[1].split())
        assert lines[0] == "OFF"
        assert edges == 0
        assert len(lines) == 2 + vertices + faces + 1
        assert b"\r" not in content
        assert len(content) < 100_000, path.name
        assert 200 <= faces <= 3_300, path.name


def test_the_reader_of_real_modelnet40_reads_it(root: Path) -> None:
    items = read_items(root)
    assert Counter(item.split for item in items) == {"train": 40 * TRAIN, "test": 40 * TEST}
    assert {item.group for item in items} == set(CATEGORIES)
    assert all(isinstance(item.read(), Mesh) for item in items)


def test_the_same_call_writes_the_same_bytes(root: Path, tmp_path: Path) -> None:
    write_modelnet40(tmp_path, train_per_category=TRAIN, test_per_category=TEST, seed=SEED)
    for path in sorted(root.rglob("*.off")):
        assert path.read_bytes() == (tmp_path / path.relative_to(root)).read_bytes(), path.name


def test_a_shape_stays_the_same_when_more_are_written(root: Path, tmp_path: Path) -> None:
    write_modelnet40(tmp_path, train_per_category=1, test_per_category=1, seed=SEED)
    for category in CATEGORIES:
        first, second = f"{category}_0001.off", f"{category}_0002.off"
        assert (root / category / "train" / first).read_bytes() == (
            tmp_path / category / "train" / first
        ).read_bytes()
        assert (root / category / "train" / second).read_bytes() == (
            tmp_path / category / "test" / second
        ).read_bytes()


def test_another_seed_writes_other_shapes(root: Path, tmp_path: Path) -> None:
    write_modelnet40(tmp_path, train_per_category=1, test_per_category=1, seed=SEED + 1)
    for category in CATEGORIES:
        name = Path(category) / "train" / f"{category}_0001.off"
        assert (root / name).read_bytes() != (tmp_path / name).read_bytes()


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_shape_is_finite_and_has_volume_area_and_no_flat_face(category: str) -> None:
    for number in range(3):
        mesh = shape(category, number)
        a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
        extent = np.ptp(mesh.vertices, axis=0)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        assert np.isfinite(mesh.vertices).all()
        assert extent.min() > 0.03 * extent.max()
        assert areas.min() > 0
        assert areas.sum() > 0.1 * extent.max() ** 2
        assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))


@pytest.mark.parametrize("category", CATEGORIES)
def test_two_shapes_of_a_category_differ(category: str) -> None:
    pairs = [(shape(category, number), shape(category, number + 1)) for number in range(3)]
    assert np.mean([relative_distance(*pair) for pair in pairs]) > 1.1


def test_the_nearest_shape_is_mostly_one_of_the_same_category() -> None:
    labels = np.repeat(CATEGORIES, 4)
    samples = [
        normalised_sample(shape(category, number), 150, number)
        for category in CATEGORIES
        for number in range(4)
    ]
    everything = np.concatenate(samples)
    away = np.stack([nearest(cloud, everything).reshape(-1, 150).mean(axis=1) for cloud in samples])
    away = away + away.T + np.diag(np.full(len(samples), np.inf))
    assert np.mean(labels[away.argmin(axis=1)] == labels) > 0.6  # by chance it would be 0.02


@pytest.mark.parametrize("category", sorted(set(CATEGORIES) - SYMMETRIC))
def test_a_shape_that_is_not_symmetric_has_one_pose(category: str) -> None:
    for number in range(3):
        mesh = shape(category, number)
        for angle_deg in (90, 180):
            assert relative_distance(mesh, mesh, angle_deg) > 1.2, (number, angle_deg)


def test_the_measure_of_symmetry_sees_that_a_bowl_is_round() -> None:
    oval = shape("bowl", 0)
    width, depth, _ = np.ptp(oval.vertices, axis=0)
    bowl = Mesh(oval.vertices * [depth / width, 1.0, 1.0], oval.faces)
    assert relative_distance(bowl, bowl, 90) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("category", sorted(SYMMETRIC))
def test_what_is_round_elsewhere_is_oval_here(category: str) -> None:
    mesh = shape(category, 0)
    assert relative_distance(mesh, mesh, 90) > 1.2


def test_progress_sees_every_shape_once(tmp_path: Path) -> None:
    seen: list[int] = []

    def watch(items: Sequence[T], description: str) -> Iterable[T]:
        seen.append(len(items))
        assert description == "modelnet40"
        return items

    write_modelnet40(tmp_path, train_per_category=1, test_per_category=1, seed=SEED, progress=watch)
    assert seen == [80]


def test_refuses_a_category_that_modelnet40_does_not_have() -> None:
    with pytest.raises(ValueError, match="got 'teapot'"):
        make_shape("teapot", generator=np.random.default_rng(0))


@pytest.mark.parametrize(("train", "test"), [(0, 1), (1, 0), (-1, 2)])
def test_refuses_an_empty_split(tmp_path: Path, train: int, test: int) -> None:
    with pytest.raises(ValueError, match=f"got {train} and {test}"):
        write_modelnet40(tmp_path, train_per_category=train, test_per_category=test, seed=0)
