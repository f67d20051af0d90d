"""ModelNet40's three layouts: what is read, what is refused, and that their frames agree."""

from collections.abc import Callable
from itertools import permutations, product
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial import KDTree

from pcrdiff.clouds.surface import Mesh, sample_oriented, sample_points
from pcrdiff.datasets import modelnet40
from pcrdiff.datasets.modelnet40 import CATEGORIES, SYMMETRIC, read_items
from tests.pcrdiff.clouds.no_numbers import NO_NUMBERS

TRIANGLE = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 0 1\n3 0 1 2\n"


def write_meshes(folder: Path, *places: str) -> None:
    for place in places:
        path = folder / f"{place}.off"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(TRIANGLE)


def write_hdf5(
    folder: Path, split: str, labels: list[int], data: np.ndarray | None = None
) -> np.ndarray:
    folder.mkdir(parents=True, exist_ok=True)
    if data is None:
        data = np.random.default_rng(0).random((len(labels), 5, 3), dtype=np.float32)
    with h5py.File(folder / f"ply_data_{split}0.h5", "w") as file:
        file["data"] = data
        file["label"] = np.array(labels, dtype=np.uint8)[:, None]
    # the official lists carry a folder that exists nowhere else
    line = f"data/modelnet40_ply_hdf5_2048/ply_data_{split}0.h5\n"
    (folder / f"{split}_files.txt").write_text(line)
    return data


def write_hdf5_layout(folder: Path) -> np.ndarray:
    write_hdf5(folder, "test", [1])
    (folder / "shape_names.txt").write_text("bed\nchair\n")
    return write_hdf5(folder, "train", [1, 0])


def write_resampled(folder: Path) -> None:
    for name in ("chair_0001", "night_stand_0002"):
        path = folder / name.rpartition("_")[0] / f"{name}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("1,2,3,0,1,0\n4,5,6,0,1,0\n")
    (folder / "modelnet40_train.txt").write_text("chair_0001\n")
    (folder / "modelnet40_test.txt").write_text("night_stand_0002\n")


def test_names_forty_categories_in_the_order_of_the_labels() -> None:
    assert len(CATEGORIES) == len(set(CATEGORIES)) == 40
    assert list(CATEGORIES) == sorted(CATEGORIES)
    assert len(SYMMETRIC) == 8
    assert set(CATEGORIES) > SYMMETRIC


def test_reads_a_tree_of_meshes(tmp_path: Path) -> None:
    write_meshes(tmp_path, "chair/train/chair_0001", "chair/test/chair_0890", "bed/train/bed_0001")
    items = read_items(tmp_path)
    assert [(item.name, item.group, item.split) for item in items] == [
        ("bed_0001", "bed", "train"),
        ("chair_0890", "chair", "test"),
        ("chair_0001", "chair", "train"),
    ]
    assert isinstance(items[0].read(), Mesh)


def test_reads_an_unpacked_archive_beside_its_system_litter(tmp_path: Path) -> None:
    write_meshes(tmp_path / "ModelNet40", "chair/train/chair_0001", "chair/train/._chair_0001")
    write_meshes(tmp_path / "__MACOSX" / "ModelNet40", "chair/train/._chair_0001")
    assert [item.name for item in read_items(tmp_path)] == ["chair_0001"]


def test_reads_hdf5_files_in_float64(tmp_path: Path) -> None:
    data = write_hdf5_layout(tmp_path / "modelnet40_ply_hdf5_2048")
    items = read_items(tmp_path)
    assert [(item.name, item.group, item.split) for item in items] == [
        ("ply_data_train0/0000", "chair", "train"),
        ("ply_data_train0/0001", "bed", "train"),
        ("ply_data_test0/0000", "chair", "test"),
    ]
    cloud = items[1].read()
    assert isinstance(cloud, np.ndarray)
    assert cloud.dtype == np.float64
    np.testing.assert_array_equal(cloud, data[1])


def test_loads_an_hdf5_file_once_for_all_its_shapes(tmp_path: Path) -> None:
    write_hdf5_layout(tmp_path)
    modelnet40._load_hdf5.cache_clear()
    for item in read_items(tmp_path):
        item.read()
    assert modelnet40._load_hdf5.cache_info().misses == 2


def test_reads_resampled_clouds_with_z_up(tmp_path: Path) -> None:
    write_resampled(tmp_path)
    items = read_items(tmp_path)
    assert [(item.name, item.group, item.split) for item in items] == [
        ("chair_0001", "chair", "train"),
        ("night_stand_0002", "night_stand", "test"),
    ]
    expected = [[-1, 3, 2, 0, 0, 1], [-4, 6, 5, 0, 0, 1]]  # normals that were along y are along z
    np.testing.assert_array_equal(items[0].read(), expected)


def test_reads_resampled_clouds_that_lost_their_normals(tmp_path: Path) -> None:
    write_resampled(tmp_path)
    (tmp_path / "chair/chair_0001.txt").write_text("1,2,3\n4,5,6\n")
    np.testing.assert_array_equal(read_items(tmp_path)[0].read(), [[-1, 3, 2], [-4, 6, 5]])


def test_turns_resampled_clouds_and_their_normals_without_mirroring_them() -> None:
    R = modelnet40._turn_upright(np.eye(3)).T
    assert np.linalg.det(R) == 1
    oriented = np.random.default_rng(0).normal(size=(5, 6))
    turned = modelnet40._turn_upright(oriented)
    np.testing.assert_array_equal(turned[:, :3], oriented[:, :3] @ R.T)
    np.testing.assert_array_equal(turned[:, 3:], oriented[:, 3:] @ R.T)


def test_reads_the_normals_of_an_hdf5_file_that_has_them(tmp_path: Path) -> None:
    data = write_hdf5_layout(tmp_path)
    normal = data[:, ::-1]
    with h5py.File(tmp_path / "ply_data_train0.h5", "r+") as file:
        file["normal"] = normal
    items = read_items(tmp_path)
    np.testing.assert_array_equal(items[1].read(), np.hstack([data[1], normal[1]]))
    assert np.asarray(items[2].read()).shape == (5, 3)  # the test file has none


@pytest.mark.parametrize("normal", [np.zeros((2, 4, 3)), np.zeros((2, 5, 3), dtype=int)])
def test_refuses_normals_that_are_not_one_a_point(tmp_path: Path, normal: np.ndarray) -> None:
    write_hdf5_layout(tmp_path)
    with h5py.File(tmp_path / "ply_data_train0.h5", "r+") as file:
        file["normal"] = normal
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 needs `normal` as floats"):
        read_items(tmp_path)


def test_refuses_a_folder_that_is_missing_or_empty(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="gone is not one"):
        read_items(tmp_path / "gone")
    with pytest.raises(FileNotFoundError, match=f"{tmp_path} holds none of them"):
        read_items(tmp_path)


def test_refuses_a_category_it_does_not_know_and_a_shape_that_comes_twice(tmp_path: Path) -> None:
    write_meshes(tmp_path / "a", "spaceship/train/spaceship_0001")
    with pytest.raises(ValueError, match="'spaceship'"):
        read_items(tmp_path / "a")
    write_meshes(tmp_path / "b", "chair/train/chair_0001", "chair/test/chair_0001")
    with pytest.raises(ValueError, match="chair_0001 is there twice"):
        read_items(tmp_path / "b")


@pytest.mark.parametrize("name", ["train_files.txt", "test_files.txt", "shape_names.txt"])
def test_refuses_hdf5_files_without_a_list(tmp_path: Path, name: str) -> None:
    write_hdf5_layout(tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(FileNotFoundError, match=name):
        read_items(tmp_path)


def test_refuses_a_listed_hdf5_file_that_is_missing_or_none(tmp_path: Path) -> None:
    write_hdf5_layout(tmp_path)
    (tmp_path / "ply_data_train0.h5").write_text("not hdf5")
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 needs to be HDF5"):
        read_items(tmp_path)
    (tmp_path / "ply_data_train0.h5").unlink()
    with pytest.raises(FileNotFoundError, match=r"ply_data_train0\.h5"):
        read_items(tmp_path)


def test_refuses_an_hdf5_schema_it_does_not_know(tmp_path: Path) -> None:
    write_hdf5_layout(tmp_path)
    with h5py.File(tmp_path / "ply_data_train0.h5", "w") as file:
        file["points"] = np.zeros((2, 5, 3))
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 .* `data` and `label`"):
        read_items(tmp_path)
    write_hdf5(tmp_path, "train", [0, 1], np.zeros((2, 5, 2), dtype=np.float32))
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 needs `data` as floats"):
        read_items(tmp_path)
    write_hdf5(tmp_path, "train", [0, 1, 1], np.zeros((2, 5, 3), dtype=np.float32))
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 needs `label` as 2 integers"):
        read_items(tmp_path)


def put(name: str, value: object) -> Callable[[h5py.File], object]:
    return lambda file: file.create_dataset(name, data=value)


ODD_ARRAYS: dict[str, tuple[str, Callable[[h5py.File], object], str]] = {
    "a scalar label": ("label", put("label", 3), "needs `label` as 2 integers, got int64"),
    "no label values": ("label", put("label", h5py.Empty("u1")), "`label` as an array, got uint8"),
    "a group": ("label", lambda file: file.create_group("label"), "as an array, got a group"),
    "text": ("label", put("label", ["bed", "chair"]), "needs `label` as 2 integers, got object"),
    "a type numpy lacks": (
        "label",
        lambda file: h5py.h5d.create(
            file.id, b"label", h5py.h5t.UNIX_D32LE, h5py.h5s.create_simple((2,))
        ),
        "needs to be HDF5 with `data` and `label`",
    ),
    "a link to nothing": (
        "data",
        lambda file: file.__setitem__("data", h5py.SoftLink("/gone")),
        "needs to be HDF5 with `data` and `label`",
    ),
    "a group of points": ("data", lambda file: file.create_group("data"), "got a group"),
    "no points": ("data", put("data", h5py.Empty("f4")), "needs `data` as an array, got float32"),
    "a scalar point": ("data", put("data", 1.0), "needs `data` as floats"),
    "more than the file holds": (
        "data",
        lambda file: file.create_dataset("data", (10**12, 5, 3), "f4", chunks=(64, 5, 3)),
        "needs `data` to be in it, its .* bytes cannot hold",
    ),
    "no normals": ("normal", put("normal", h5py.Empty("f4")), "needs `normal` as an array"),
    "a scalar normal": ("normal", put("normal", 1.0), "needs `normal` as floats"),
}


@pytest.mark.parametrize("case", ODD_ARRAYS)
def test_refuses_an_hdf5_file_with(tmp_path: Path, case: str) -> None:
    name, make, message = ODD_ARRAYS[case]
    write_hdf5_layout(tmp_path)
    with h5py.File(tmp_path / "ply_data_train0.h5", "r+") as file:
        if name in file:
            del file[name]
        make(file)
    with pytest.raises(ValueError, match=rf"ply_data_train0\.h5 .*{message}") as refused:
        read_items(tmp_path)
    assert "\n" not in str(refused.value)


def test_reads_an_hdf5_file_much_smaller_than_its_arrays(tmp_path: Path) -> None:
    write_hdf5_layout(tmp_path)
    with h5py.File(tmp_path / "ply_data_train0.h5", "r+") as file:
        del file["data"]
        file.create_dataset("data", data=np.zeros((2, 10**6, 3), "f4"), compression=9)
    assert np.asarray(read_items(tmp_path)[0].read()).shape == (10**6, 3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("caf\xe9_0001\n".encode("latin-1"), r"line 2, needs .* UTF-8, .*0xe9.*Latin-1"),
        ("chair_0001\n".encode("utf-16"), "needs to be text in UTF-8, it begins as UTF-16 does"),
    ],
)
def test_refuses_a_list_in_another_encoding(tmp_path: Path, content: bytes, message: str) -> None:
    write_resampled(tmp_path)
    lead = b"" if content.startswith(b"\xff") else b"chair_0001\n"
    (tmp_path / "modelnet40_train.txt").write_bytes(lead + content)
    with pytest.raises(ValueError, match=rf"modelnet40_train\.txt.*{message}"):
        read_items(tmp_path)


def test_reads_a_list_with_a_byte_order_mark(tmp_path: Path) -> None:
    write_resampled(tmp_path)
    (tmp_path / "modelnet40_train.txt").write_bytes(b"\xef\xbb\xbfchair_0001\r\n")
    assert read_items(tmp_path)[0].name == "chair_0001"


def test_refuses_a_label_out_of_range_and_a_name_that_is_no_category(tmp_path: Path) -> None:
    write_hdf5_layout(tmp_path)
    write_hdf5(tmp_path, "train", [0, 2])
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5 needs labels in 0\.\.1.*got 2"):
        read_items(tmp_path)
    (tmp_path / "shape_names.txt").write_text("bed\nspaceship\n")
    with pytest.raises(ValueError, match=r"shape_names\.txt .* 'spaceship'"):
        read_items(tmp_path)


def test_refuses_a_shape_with_nan_when_it_is_read(tmp_path: Path) -> None:
    data = write_hdf5_layout(tmp_path)
    data[1, 2, 0] = np.nan
    write_hdf5(tmp_path, "train", [0, 1], data)
    items = read_items(tmp_path)
    items[0].read()
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5, shape 1, needs finite"):
        items[1].read()


def test_refuses_a_shape_whose_numbers_cannot_be_of_a_unit_sphere(tmp_path: Path) -> None:
    data = write_hdf5_layout(tmp_path)
    write_hdf5(tmp_path, "train", [0, 1], data.view(">f4").astype("<f4"))
    with pytest.raises(ValueError, match=r"ply_data_train0\.h5, shape 0, needs .*coordinates"):
        read_items(tmp_path)[0].read()


def test_refuses_resampled_clouds_without_a_list_or_a_listed_file(tmp_path: Path) -> None:
    write_resampled(tmp_path)
    (tmp_path / "night_stand/night_stand_0002.txt").unlink()
    with pytest.raises(FileNotFoundError, match=r"night_stand_0002\.txt is missing"):
        read_items(tmp_path)
    (tmp_path / "modelnet40_test.txt").write_text("")
    with pytest.raises(ValueError, match=r"modelnet40_test\.txt .* empty"):
        read_items(tmp_path)
    (tmp_path / "modelnet40_train.txt").unlink()
    (tmp_path / "modelnet40_test.txt").unlink()
    with pytest.raises(FileNotFoundError, match=r"modelnet40_train\.txt"):
        read_items(tmp_path)


@pytest.mark.parametrize("text", ["", "1,2\n", "1,2,3,0\n", "a,b,c\n", "1,2,3\n1,2\n", "1,2,3,\n"])
def test_refuses_a_broken_resampled_cloud(tmp_path: Path, text: str) -> None:
    write_resampled(tmp_path)
    (tmp_path / "chair/chair_0001.txt").write_text(text)
    with pytest.raises(ValueError, match=r"chair_0001\.txt.* needs"):
        read_items(tmp_path)[0].read()


@pytest.mark.parametrize("word", [*NO_NUMBERS, "1 2", ""])
@pytest.mark.parametrize("column", [0, 2, 5])
def test_refuses_a_resampled_cloud_with_what_is_no_finite_number(
    tmp_path: Path, word: str, column: int
) -> None:
    write_resampled(tmp_path)
    row = ["1", "2", "3", "0", "1", "0"]
    row[column] = word
    (tmp_path / "chair/chair_0001.txt").write_text(
        f"# made by hand\n1,2,3,0,1,0\n{','.join(row)}\n"
    )
    with pytest.raises(ValueError, match=r"chair_0001\.txt, line 3, .* finite numbers") as refused:
        read_items(tmp_path)[0].read()
    assert repr(word) in str(refused.value)


@pytest.mark.real
@pytest.mark.parametrize(
    ("folder", "train", "test", "num_categories"),
    [
        ("modelnet10_hdf5_1024", 3991, 308, 10),
        ("modelnet40_normal_resampled", 72, 18, 20),
        ("modelnet40_off", 23, 1, 8),
    ],
)
def test_reads_every_real_shape(
    real_data: Path, folder: str, train: int, test: int, num_categories: int
) -> None:
    items = read_items(real_data / folder)
    splits = [item.split for item in items]
    assert (splits.count("train"), splits.count("test")) == (train, test)
    assert len({item.group for item in items}) == num_categories
    assert len({item.name for item in items}) == len(items)
    for item in items:
        assert len(sample_points(item.read(), 64, generator=np.random.default_rng(0))) == 64


def lay_category_over_itself(root: Path, category: str) -> np.ndarray:
    """Sample a category's shapes, each centred in its box and scaled, into one cloud."""
    generator = np.random.default_rng(0)
    shapes = [item.read() for item in read_items(root) if item.group == category][:40]
    clouds = [sample_points(shape, 500, generator=generator) for shape in shapes]
    clouds = [cloud - (cloud.max(axis=0) + cloud.min(axis=0)) / 2 for cloud in clouds]
    return np.concatenate([c / np.linalg.norm(c, axis=1).max() for c in clouds])


def turn_to_all_axes() -> list[np.ndarray]:
    """List the 24 rotations that carry axes to axes, the identity first."""
    rotations = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]
    return [R for R in rotations if np.linalg.det(R) > 0]


def measure_distance(cloud: np.ndarray, other: np.ndarray) -> float:
    """Give the mean distance of a cloud's points from the other cloud."""
    return float(np.mean(KDTree(other).query(cloud)[0]))


@pytest.mark.real
@pytest.mark.parametrize("other", ["modelnet40_off", "modelnet10_hdf5_1024"])
@pytest.mark.parametrize("category", ["bed", "chair", "toilet"])
def test_the_layouts_share_one_frame(real_data: Path, other: str, category: str) -> None:
    here = lay_category_over_itself(real_data / "modelnet40_normal_resampled", category)
    there = lay_category_over_itself(real_data / other, category)
    distances = [
        measure_distance(here @ R.T, there) + measure_distance(there, here @ R.T)
        for R in turn_to_all_axes()
    ]
    assert int(np.argmin(distances)) == 0


@pytest.mark.real
@pytest.mark.parametrize("folder", ["modelnet40_normal_resampled", "modelnet40_off"])
def test_real_normals_lie_across_the_surface(real_data: Path, folder: str) -> None:
    cosines = []
    for item in read_items(real_data / folder)[::5]:
        oriented = sample_oriented(item.read(), 2000, generator=np.random.default_rng(0))
        points, normals = oriented[:, :3], oriented[:, 3:]
        nearest = np.asarray(KDTree(points).query(points, 2)[1])[:, 1]
        along = points[nearest] - points
        apart = np.linalg.norm(along, axis=1)
        cosine = np.abs((along * normals).sum(axis=1))[apart > 0] / apart[apart > 0]
        cosines.append(np.median(cosine))
    assert np.median(cosines) < 0.1  # where normals are turned wrongly or shuffled: 0.4
