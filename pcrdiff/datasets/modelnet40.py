"""ModelNet40 in each of its three official layouts."""

import hashlib
from collections.abc import Callable
from fnmatch import fnmatchcase
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
from jaxtyping import Float, Int64

from pcrdiff.clouds.number_rows import QUOTED, read_lines, read_rows, split_lines, without_comments
from pcrdiff.clouds.off import read_off
from pcrdiff.clouds.surface import Cloud, Oriented, check_cloud, check_extent
from pcrdiff.datasets.items import RawItem
from pcrdiff.datasets.listing import check_names, entries, list_files, list_folders, refuse_several

CATEGORIES: tuple[str, ...] = (
    "airplane", "bathtub", "bed", "bench", "bookshelf", "bottle", "bowl", "car", "chair", "cone",
    "cup", "curtain", "desk", "door", "dresser", "flower_pot", "glass_box", "guitar", "keyboard",
    "lamp", "laptop", "mantel", "monitor", "night_stand", "person", "piano", "plant", "radio",
    "range_hood", "sink", "sofa", "stairs", "stool", "table", "tent", "toilet", "tv_stand", "vase",
    "wardrobe", "xbox",
)  # fmt: skip
"""The 40 official names, alphabetical: a label is an index into them."""

SYMMETRIC = frozenset({"bottle", "bowl", "cone", "cup", "flower_pot", "lamp", "tent", "vase"})
"""Categories whose shapes look the same after a turn about an axis, so their pose is luck."""

LARGEST_RATIO = 1100
"""How many times an array may be larger than its HDF5 file: deflate reaches 1,032."""

OfficialSplit = Literal["train", "test"]
SPLITS: tuple[OfficialSplit, ...] = ("train", "test")


def read_items(root: Path) -> list[RawItem]:
    """List the shapes of ModelNet40, ModelNet10 or a part of them, whatever the layout.

    Three layouts are recognised, in ``root`` or in a folder right below it:

    - the original meshes, ``<category>/{train,test}/<name>.off``: read as a ``Mesh`` in the
      file's own length unit, z up;
    - ``modelnet40_ply_hdf5_2048``: clouds in the unit sphere, in the file's own axes, with
      normals where the file has ``normal``;
    - ``modelnet40_normal_resampled``: clouds in the unit sphere, with normals, turned from its y up
      into the frame of the meshes.

    Args:
        root: The data set's folder.

    Returns:
        One item per shape, in an order that depends on the file names alone; ``group`` is the
        category, ``split`` the official one.

    Raises:
        FileNotFoundError: No such folder, none of the layouts in it, or a list or a listed file
            is missing.
        ValueError: A list, a label, a category or a name is not ModelNet40's, or there is more than
            one data set or layout.
        OSError: A folder cannot be listed.
    """
    if not root.is_dir():
        raise FileNotFoundError(f"ModelNet40 needs its folder, {root} is not one")
    found = [
        (folder, layout)
        for folder in (root, *list_folders(root))
        for layout, (holds, _) in LAYOUTS.items()
        if holds(folder)
    ]
    if not found:
        raise FileNotFoundError(
            f"ModelNet40 needs <category>/train/*.off, train_files.txt with ply_data_train0.h5, or "
            f"modelnet40_train.txt with <category>/*.txt, {root} holds none of them"
        )
    refuse_several(found, root)
    folder, layout = found[0]
    _, list_items = LAYOUTS[layout]
    return _refuse_repetition(list_items(folder), folder)


def _refuse_repetition(items: list[RawItem], folder: Path) -> list[RawItem]:
    seen: set[str] = set()
    for item in items:
        if item.name in seen:
            raise ValueError(f"{folder} needs each shape once, {item.name} is there twice")
        seen.add(item.name)
    return items


def _check_category(name: str, where: Path) -> str:
    if name not in CATEGORIES:
        raise ValueError(f"{where} needs categories of ModelNet40, got {name!r}")
    return name


def _read_lines(path: Path) -> list[str]:
    if not path.is_file():
        raise FileNotFoundError(f"ModelNet40 needs the list {path}, which is missing")
    lines = [line.text.strip() for line in read_lines(path)]
    if not lines:
        raise ValueError(f"{path} needs at least one name, it is empty")
    return lines


def _holds_meshes(folder: Path) -> bool:
    return any(
        list_files(split, ".off")
        for category in list_folders(folder)
        for split in list_folders(category)
        if split.name in SPLITS
    )


def _list_meshes(folder: Path) -> list[RawItem]:
    return [item for category in list_folders(folder) for item in _list_category(category)]


def _list_category(category: Path) -> list[RawItem]:
    items = []
    for place in (category, *list_folders(category)):
        paths = list_files(place, ".off")
        if not paths:
            continue
        _check_category(category.name, category.parent)
        if place.name not in SPLITS:
            raise ValueError(f"{paths[0]} needs to lie in {category}/train or {category}/test")
        check_names(paths, rf"{category.name}_[0-9]{{4}}\.off", f"{category.name}_0001.off")
        split: OfficialSplit = "train" if place.name == "train" else "test"
        items += [
            RawItem(path.stem, category.name, split, partial(read_off, path), path)
            for path in paths
        ]
    return items


def _holds_hdf5(folder: Path) -> bool:
    names = {entry.name for entry in entries(folder)}
    lists = {"train_files.txt", "test_files.txt", "shape_names.txt"}
    return bool(names & lists) or any(fnmatchcase(name, "ply_data_*.h5") for name in names)


def _list_hdf5(folder: Path) -> list[RawItem]:
    names_path = folder / "shape_names.txt"
    names = [_check_category(name, names_path) for name in _read_lines(names_path)]
    return [item for split in SPLITS for item in _list_hdf5_split(folder, split, names)]


def _list_hdf5_split(folder: Path, split: OfficialSplit, names: list[str]) -> list[RawItem]:
    items = []
    lines = _read_lines(folder / f"{split}_files.txt")
    paths = [folder / Path(line).name for line in lines]  # official ones carry authors' folders
    check_names(paths, rf"ply_data_{split}[0-9]+\.h5", f"ply_data_{split}0.h5")
    for path in paths:
        clouds, labels = _read_hdf5(path)
        _check_labels(labels, len(names), path)
        for index, label in enumerate(labels):
            item_name = f"{path.stem}/{index:04d}"
            read = partial(_read_hdf5_cloud, path, index)
            digest = hashlib.sha256(clouds[index, :, :3].tobytes()).hexdigest()
            items.append(RawItem(item_name, names[label], split, read, path, digest))
    return items


def _check_labels(labels: Int64[np.ndarray, " shapes"], num_names: int, path: Path) -> None:
    outside = (labels < 0) | (labels >= num_names)
    if outside.any():
        raise ValueError(
            f"{path} needs labels in 0..{num_names - 1}, as many as shape_names.txt has names, "
            f"got {labels[outside][0]} for shape {outside.argmax()}"
        )


def _read_hdf5_cloud(path: Path, index: int) -> Cloud | Oriented:
    clouds, _ = _read_hdf5(path)
    where = f"{path}, shape {index},"
    return check_extent(check_cloud(clouds[index], where), where)


def _read_hdf5(
    path: Path,
) -> tuple[Float[np.ndarray, "shapes points channels"], Int64[np.ndarray, " shapes"]]:
    if not path.is_file():
        raise FileNotFoundError(f"ModelNet40 needs {path}, which its list names and is missing")
    return _load_hdf5(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=2)  # shapes are read one by one, in order: a file of 50 MB is loaded once
def _load_hdf5(
    path: Path, modified: int
) -> tuple[Float[np.ndarray, "shapes points channels"], Int64[np.ndarray, " shapes"]]:
    del modified  # part of the key only: a file that changed is read again
    try:
        with h5py.File(path) as file:
            data, label, normal = _read_arrays(file, path)
    except (OSError, KeyError, TypeError, RuntimeError) as error:  # as h5py has it
        raise ValueError(f"{path} needs to be HDF5 with `data` and `label`, got {error}") from error
    clouds = data if normal is None else np.concatenate([data, normal], axis=2)
    return clouds, label.reshape(-1).astype(np.int64)


def _read_arrays(file: h5py.File, path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Read points, labels and normals, once each is known to be what it should."""
    data = _sized(file["data"], path)
    if data.ndim != 3 or data.shape[2] != 3 or data.dtype.kind != "f":
        raise ValueError(f"{path} needs `data` as floats [shapes, points, 3], got {_say(data)}")
    label = _sized(file["label"], path)
    if label.dtype.kind not in "iu" or label.shape not in ((len(data),), (len(data), 1)):
        raise ValueError(f"{path} needs `label` as {len(data)} integers, got {_say(label)}")
    normal = _sized(file["normal"], path) if "normal" in file else None
    if normal is not None and (normal.shape != data.shape or normal.dtype.kind != "f"):
        raise ValueError(f"{path} needs `normal` as floats {data.shape}, got {_say(normal)}")
    return data[:], label[:], None if normal is None else normal[:]


def _sized(entry: h5py.Dataset | h5py.Group, path: Path) -> h5py.Dataset:
    """Refuse what is no array, or more than the file can hold, before memory is asked for."""
    if not isinstance(entry, h5py.Dataset) or entry.shape is None:
        raise ValueError(f"{path} needs `{entry.name[1:]}` as an array, got {_say(entry)}")
    if entry.nbytes > LARGEST_RATIO * path.stat().st_size:
        raise ValueError(
            f"{path} needs `{entry.name[1:]}` to be in it, its {path.stat().st_size} bytes "
            f"cannot hold {_say(entry)}"
        )
    return entry


def _say(entry: h5py.Dataset | h5py.Group) -> str:
    if not isinstance(entry, h5py.Dataset):
        return "a group"
    return f"{entry.dtype} {'without any value' if entry.shape is None else entry.shape}"


def _holds_resampled(folder: Path) -> bool:
    return any(fnmatchcase(entry.name, "modelnet40_*.txt") for entry in entries(folder)) or any(
        fnmatchcase(entry.name, f"{category.name}_*.txt")
        for category in list_folders(folder)
        if category.name in CATEGORIES
        for entry in entries(category)
    )


def _list_resampled(folder: Path) -> list[RawItem]:
    items = []
    for split in SPLITS:
        list_path = folder / f"modelnet40_{split}.txt"
        for name in _read_lines(list_path):
            category = _check_category(name.rpartition("_")[0], list_path)
            path = folder / category / f"{name}.txt"
            check_names([path], rf"{category}_[0-9]{{4}}\.txt", f"{category}_0001.txt")
            if not path.is_file():
                raise FileNotFoundError(f"{list_path} names {name}, but {path} is missing")
            items.append(RawItem(name, category, split, partial(_read_resampled, path), path))
    return items


def _read_resampled(path: Path) -> Cloud | Oriented:
    lines = split_lines(without_comments(path.read_bytes()), path)
    width = lines[0].text.count(",") + 1 if lines else 0
    other = next((line for line in lines if line.text.count(",") + 1 != width), None)
    if other is not None:
        raise ValueError(
            f"{path}, line {other.number}, needs {width} numbers as the first line has, "
            f"got {other.text[:QUOTED]!r}"
        )
    points = read_rows(lines, range(width), path, "lines `x,y,z,nx,ny,nz`", ",")
    return _turn_upright(check_cloud(points, str(path)))


def _turn_upright(points: Cloud | Oriented) -> Cloud | Oriented:
    """Turn y up into z up, by half a turn about the bisector of the two axes.

    This, and not a quarter turn about x, lays the chairs, beds and toilets on those of the other
    layouts: there they face the other way.
    """
    x, y, z = np.moveaxis(points.reshape(len(points), -1, 3), 2, 0)  # of points, and of normals
    return np.stack([-x, z, y], axis=2).reshape(points.shape)


LAYOUTS: dict[str, tuple[Callable[[Path], bool], Callable[[Path], list[RawItem]]]] = {
    "meshes": (_holds_meshes, _list_meshes),
    "HDF5 files": (_holds_hdf5, _list_hdf5),
    "resampled clouds": (_holds_resampled, _list_resampled),
}
"""For each layout: does a folder hold it, and its items."""
