"""Pair files: HDF5, checked before a pair is believed."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch
from torch import Tensor

from pcrdiff.registration import SPLITS, Pairs
from pipeline.formats.files import written_beside

PAIR_SCHEMA = 1
RIGID_TOLERANCE, NORMAL_TOLERANCE = 1e-6, 1e-3
KINDS = {"source": "f", "target": "f", "T_target_source": "f", "item": "iu"}
"""numpy's kinds of number in the datasets of a split."""
TEXT = "OS"
"""numpy's kinds of text in a dataset."""
LARGEST_RATIO = 1100
"""How many times a dataset may be larger than its file: deflate reaches 1,032."""
NORMALS = ("source_normals", "target_normals")
"""Datasets that a split has where the scenario keeps given normals; both or neither."""
SHAPE = "shape"
"""Dataset that a split has where answers are measured by it; files from before have none."""


@dataclass(frozen=True)
class Streamed:
    """The pairs of a split as they come, and how many will."""

    count: int
    blocks: Iterable[Pairs]


def write_pairs(
    path: Path, splits: Mapping[str, Streamed], label: str, attributes: Mapping[str, Any]
) -> None:
    """Write a pair file block by block; the same pairs give the same bytes, however they are cut.

    Args:
        path: The ``.h5`` file.
        splits: ``train``, ``val`` and ``test``.
        label: What a pair's group is called: ``category`` or ``scene``.
        attributes: ``scenario``, ``unit``, ``seed`` and ``provenance``, a JSON object.

    Raises:
        ValueError: A split has not as many pairs as it said, or none.
        OSError: The disk is full, say; then there is no file, or the one that was there.
    """
    with written_beside(path) as disk, h5py.File(disk, "w", libver=("v110", "v110")) as file:
        for name in ("scenario", "unit", "seed"):
            file.attrs[name] = attributes[name]
        file.attrs["schema"] = PAIR_SCHEMA
        file.attrs["provenance"] = json.dumps(attributes["provenance"], sort_keys=True)
        for name in SPLITS:
            _write_split(file.create_group(name), splits[name], label)


def _write_split(group: h5py.Group, streamed: Streamed, label: str) -> None:
    written, groups = 0, list[str]()
    for block in streamed.blocks:
        for field in (*KINDS, *NORMALS, SHAPE):
            values = getattr(block, field)
            if values is None:
                continue
            rows = values.numpy()
            if not written:
                group.create_dataset(field, (streamed.count, *rows.shape[1:]), rows.dtype)
            group[field][written : written + len(rows)] = rows
        written += len(block)
        groups += block.group
    if written != streamed.count or not written:
        raise ValueError(f"{group.name} needs its {streamed.count} pairs, got {written}")
    group.create_dataset(label, data=groups, dtype=h5py.string_dtype())


def read_pairs(path: Path, split: str) -> Pairs:
    """Read one split of a pair file, and refuse what no method should be shown.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a pair file of this schema, a shape does not fit, a coordinate is
            not finite, a pose is not rigid, or a normal has no unit length; one sentence with the
            file.
    """
    with _opened(path, f"a split {split!r}") as file:
        return _checked(file[split], f"{path} {split}")


def read_attributes(path: Path) -> dict[str, Any]:
    """What a pair file says of itself: the attributes that ``write_pairs`` was given, and ``schema``.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a pair file of this schema; one sentence with the file.
    """
    with _opened(path, "a provenance") as file:
        attributes = {name: file.attrs[name] for name in ("scenario", "unit", "seed", "schema")}
        provenance = json.loads(file.attrs["provenance"])
        if not isinstance(provenance, dict):
            raise ValueError(f"{path} needs its provenance as a JSON object, has {provenance!r}")
        return attributes | {"provenance": provenance}


@contextmanager
def _opened(path: Path, wanted: str) -> Iterator[h5py.File]:
    """Open a pair file of this schema to read what is ``wanted`` of it."""
    if not path.is_file():
        raise FileNotFoundError(f"a pair file is needed at {path}, there is none: run preprocess")
    try:
        with h5py.File(path) as file:
            schema = file.attrs.get("schema")
            if not isinstance(schema, int | np.integer) or schema != PAIR_SCHEMA:
                raise ValueError(f"{path} needs schema {PAIR_SCHEMA}, has {schema}")
            yield file
    except (KeyError, OSError, TypeError, RuntimeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is not a pair file with {wanted}: {error}") from error


def _checked(group: h5py.Group, where: str) -> Pairs:
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{where} is not a pair file's group but {group}")
    label = next((name for name in ("category", "scene") if name in group), None)
    if label is None:
        raise ValueError(f"{where} needs a dataset category or scene, has {sorted(group)}")
    source, target, poses, item, names = (
        _array(group, name, kinds, where) for name, kinds in {**KINDS, label: TEXT}.items()
    )
    count = len(source)
    shapes = {"source": source.shape[2:], "target": target.shape[2:], "pose": poses.shape[1:]}
    if shapes != {"source": (3,), "target": (3,), "pose": (4, 4)}:
        raise ValueError(f"{where} needs clouds [P, N, 3] and poses [P, 4, 4], has {shapes}")
    if (item.ndim, names.ndim) != (1, 1) or 0 in (source.shape[1], target.shape[1]):
        raise ValueError(f"{where} needs points, and one item and {label} for each pair of clouds")
    lengths = {len(target), len(poses), len(item), len(names)}
    if lengths != {count} or count == 0:
        raise ValueError(f"{where} needs as many of each as of sources ({count}), has {lengths}")
    for name, values in (("source", source), ("target", target), ("pose", poses)):
        if not np.isfinite(values).all():
            raise ValueError(f"{where} needs finite values, {name} has NaN or infinity")
    _check_rigid(poses, where)
    return Pairs(
        torch.from_numpy(source.astype(np.float32)),
        torch.from_numpy(target.astype(np.float32)),
        torch.from_numpy(poses.astype(np.float64)),
        torch.from_numpy(item.astype(np.int64)),
        tuple(_decode(name, f"{where} {label}") for name in names),
        **_normals(group, [source, target], where),
        shape=_shape(group, count, where),
    )


def _normals(
    group: h5py.Group, clouds: Sequence[np.ndarray[Any, Any]], where: str
) -> dict[str, Tensor]:
    """The normals of both clouds by the names of their datasets; nothing where there are none."""
    found = [name for name in NORMALS if name in group]
    if len(found) == 1:
        raise ValueError(f"{where} needs normals of both clouds or of neither, has {found[0]}")
    return {
        name: _unit(_array(group, name, "f", where), points, f"{where} {name}")
        for name, points in zip(NORMALS, clouds, strict=True)
        if found
    }


def _shape(group: h5py.Group, count: int, where: str) -> Tensor | None:
    """The shapes of ``count`` pairs; None where there are none."""
    if SHAPE not in group:
        return None
    points = _array(group, SHAPE, "f", where)
    if points.ndim != 3 or points.shape[::2] != (count, 3) or points.shape[1] == 0:
        raise ValueError(f"{where} needs shapes [{count}, n, 3] with n > 0, has {points.shape}")
    if not np.isfinite(points).all():
        raise ValueError(f"{where} needs finite values, {SHAPE} has NaN or infinity")
    return torch.from_numpy(points.astype(np.float32))


def _unit(normals: np.ndarray[Any, Any], points: np.ndarray[Any, Any], where: str) -> Tensor:
    if normals.shape != points.shape:
        raise ValueError(f"{where} needs one a point {points.shape}, has {normals.shape}")
    good = np.abs(np.linalg.norm(normals, axis=-1) - 1) <= NORMAL_TOLERANCE  # NaN is not
    if not good.all():
        bad = int(np.argmin(good.all(axis=1)))
        raise ValueError(f"{where} needs finite vectors of unit length, pair {bad} has another")
    return torch.from_numpy(normals.astype(np.float32))


def _array(group: h5py.Group, name: str, kinds: str, where: str) -> np.ndarray[Any, Any]:
    dataset = group[name]
    if (
        not isinstance(dataset, h5py.Dataset)
        or dataset.ndim == 0
        or dataset.dtype.kind not in kinds
        or (kinds == TEXT and h5py.check_string_dtype(dataset.dtype) is None)
    ):
        raise ValueError(f"{where} needs {name} as an array of kind {kinds}, has {dataset}")
    if dataset.nbytes > LARGEST_RATIO * Path(dataset.file.filename).stat().st_size:
        raise ValueError(f"{where} needs {name} to be in its file, which cannot hold {dataset}")
    content: np.ndarray[Any, Any] = dataset[:]
    return content


def _decode(name: bytes, where: str) -> str:
    try:
        return name.decode()
    except UnicodeDecodeError as error:
        raise ValueError(f"{where} needs text in UTF-8, has {bytes(name)!r}") from error


def _check_rigid(poses: np.ndarray[Any, Any], where: str) -> None:
    R = poses[:, :3, :3]
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bottom = np.abs(poses[:, 3] - np.array([0, 0, 0, 1])).max(axis=1)
    bad = (off > RIGID_TOLERANCE) | (bottom > 0) | (np.linalg.det(R) < 0)
    if bad.any():
        raise ValueError(f"{where} needs rigid poses, pair {int(np.argmax(bad))} has another")
