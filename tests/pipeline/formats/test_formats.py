"""What stages hand to each other: whole or not at all, the same bytes twice, checked when read."""

import csv
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from pcrdiff.evaluation import Estimates
from pcrdiff.registration import SPLITS, Pairs
from pcrdiff.training.budget import Epoch
from pcrdiff.verdict import Verdict
from pipeline.formats.answers import ANSWER, CHAMFER, JUDGED, write_ablation, write_estimates
from pipeline.formats.files import write_atomically, write_json
from pipeline.formats.pairs import Streamed, read_attributes, read_pairs, write_pairs
from pipeline.formats.weights import read_weights, write_curve, write_weights
from tests.described import REPOSITORY
from tests.tiny import files_below

ATTRIBUTES = {"scenario": "tiny", "unit": "unit sphere", "seed": 7, "provenance": {"b": 1, "a": 2}}


def quarter_turn(shift: float = 0.0) -> torch.Tensor:
    """90 degrees about z, then ``shift`` along x."""
    T_target_source = torch.eye(4, dtype=torch.float64)
    T_target_source[:2, :2] = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
    T_target_source[0, 3] = shift
    return T_target_source


def synthetic_pairs(count: int = 3) -> Pairs:
    generator = torch.Generator().manual_seed(count)
    return Pairs(
        torch.randn(count, 5, 3, generator=generator),
        torch.randn(count, 6, 3, generator=generator),
        torch.stack([quarter_turn(0.1 * k) for k in range(count)]),
        torch.arange(count) + 10,
        tuple(f"group {k}" for k in range(count)),
    )


def streamed(splits: dict[str, Pairs], size: int = 2) -> dict[str, Streamed]:
    """Each split in blocks of ``size`` pairs."""
    return {
        name: Streamed(len(pairs), map(pairs.select, torch.split(torch.arange(len(pairs)), size)))
        for name, pairs in splits.items()
    }


def write_synthetic(path: Path, label: str = "category") -> dict[str, Pairs]:
    splits = {name: synthetic_pairs(count) for name, count in zip(SPLITS, (3, 1, 2), strict=True)}
    write_pairs(path, streamed(splits), label, ATTRIBUTES)
    return splits


# Writing.


def test_makes_the_folder_and_replaces_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "file.txt"
    write_atomically(path, b"old")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    assert files_below(tmp_path) == ["a/b/file.txt"]


def test_others_may_read_what_is_written(tmp_path: Path) -> None:
    write_atomically(tmp_path / "file", b"")
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o644


def test_content_that_is_none_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    write_atomically(tmp_path / "file", b"old")
    with pytest.raises(TypeError):
        write_atomically(tmp_path / "file", "text")  # type: ignore[arg-type]
    assert (tmp_path / "file").read_bytes() == b"old"
    assert files_below(tmp_path) == ["file"]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("moment", ["chmod", "replace"])
def test_an_error_at_the_end_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str, error: BaseException
) -> None:
    def fail(*_: object) -> None:
        raise error

    write_atomically(tmp_path / "file", b"old")
    monkeypatch.setattr(Path, moment, fail)
    with pytest.raises(type(error)):
        write_atomically(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"old"
    assert files_below(tmp_path) == ["file"]


def test_a_disk_that_fills_up_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full:
        def __init__(self, handle: int) -> None:
            self.handle = handle

        def __enter__(self) -> "Full":
            return self

        def __exit__(self, *_: object) -> None:
            os.close(self.handle)

        def write(self, content: bytes) -> None:
            os.write(self.handle, content[: len(content) // 2])
            raise OSError(28, "No space left on device")

    write_atomically(tmp_path / "file", b"old")
    monkeypatch.setattr(os, "fdopen", lambda handle, _: Full(handle))
    with pytest.raises(OSError, match="No space left"):
        write_atomically(tmp_path / "file", b"new content")
    assert (tmp_path / "file").read_bytes() == b"old"
    assert files_below(tmp_path) == ["file"]


def test_json_is_sorted_and_ends_its_last_line(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"b": 1, "a": 0.5})
    assert (tmp_path / "a.json").read_bytes() == b'{\n  "a": 0.5,\n  "b": 1\n}\n'


# Pairs.


@pytest.mark.parametrize("label", ["category", "scene"])
def test_pairs_come_back_as_they_were(tmp_path: Path, label: str) -> None:
    splits = write_synthetic(tmp_path / "pairs.h5", label)
    for name in SPLITS:
        read = read_pairs(tmp_path / "pairs.h5", name)
        for field in ("source", "target", "T_target_source", "item"):
            expected: torch.Tensor = getattr(splits[name], field)
            assert getattr(read, field).dtype == expected.dtype
            assert torch.equal(getattr(read, field), expected)
        assert read.group == splits[name].group


def test_the_same_pairs_give_the_same_bytes(tmp_path: Path) -> None:
    write_synthetic(tmp_path / "a.h5")
    write_synthetic(tmp_path / "b.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_the_bytes_do_not_depend_on_how_pairs_are_cut_into_blocks(
    tmp_path: Path, size: int
) -> None:
    splits = {name: with_normals(synthetic_pairs(5)) for name in SPLITS}
    write_pairs(tmp_path / "whole.h5", streamed(splits, 5), "scene", ATTRIBUTES)
    write_pairs(tmp_path / "cut.h5", streamed(splits, size), "scene", ATTRIBUTES)
    assert (tmp_path / "cut.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()


@pytest.mark.parametrize("promised", [2, 4])
def test_refuses_another_number_of_pairs_than_a_split_said_and_leaves_the_old_file(
    tmp_path: Path, promised: int
) -> None:
    write_synthetic(tmp_path / "pairs.h5")
    before = (tmp_path / "pairs.h5").read_bytes()
    splits = streamed({name: synthetic_pairs(3) for name in SPLITS}, 1)
    splits["val"] = Streamed(promised, splits["val"].blocks)
    with pytest.raises((ValueError, TypeError)):
        write_pairs(tmp_path / "pairs.h5", splits, "category", ATTRIBUTES)
    assert (tmp_path / "pairs.h5").read_bytes() == before
    assert files_below(tmp_path) == ["pairs.h5"]


def test_a_pair_that_cannot_be_made_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    def breaking() -> Iterator[Pairs]:
        yield synthetic_pairs(2)
        raise ValueError("no pair of chair_7")

    write_synthetic(tmp_path / "pairs.h5")
    before = (tmp_path / "pairs.h5").read_bytes()
    splits = streamed({name: synthetic_pairs(3) for name in SPLITS})
    splits["val"] = Streamed(4, breaking())
    with pytest.raises(ValueError, match="no pair of chair_7"):
        write_pairs(tmp_path / "pairs.h5", splits, "category", ATTRIBUTES)
    assert (tmp_path / "pairs.h5").read_bytes() == before
    assert files_below(tmp_path) == ["pairs.h5"]


@pytest.mark.parametrize("room", [0, 3000, 9000])
def test_a_disk_that_fills_up_under_a_pair_file_leaves_the_old_one_and_nothing_else(
    tmp_path: Path, room: int
) -> None:
    splits = {name: synthetic_pairs(40) for name in SPLITS}
    write_pairs(tmp_path / "pairs.h5", streamed(splits), "category", ATTRIBUTES)
    before = (tmp_path / "pairs.h5").read_bytes()
    assert len(before) > room
    code = (
        "import resource, signal, sys\n"
        "from pathlib import Path\n"
        "from tests.pipeline.formats.test_formats import *\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))\n"
        "splits = streamed({name: synthetic_pairs(40) for name in SPLITS})\n"
        "try:\n"
        f"    write_pairs(Path({str(tmp_path / 'pairs.h5')!r}), splits, 'category', ATTRIBUTES)\n"
        "except (OSError, RuntimeError) as error:\n"
        "    sys.exit(7)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, check=False)
    assert done.returncode == 7
    assert (tmp_path / "pairs.h5").read_bytes() == before
    assert files_below(tmp_path) == ["pairs.h5"]


def test_memory_does_not_grow_with_the_number_of_pairs(tmp_path: Path) -> None:
    def blocks(count: int) -> Iterator[Pairs]:
        for _ in range(count):
            clouds = torch.zeros(4, 512, 3)
            poses = torch.eye(4, dtype=torch.float64).repeat(4, 1, 1)
            yield Pairs(clouds, clouds.clone(), poses, torch.arange(4), ("a",) * 4)

    def peak(count: int) -> int:
        splits = {name: Streamed(4 * count, blocks(count)) for name in SPLITS}
        tracemalloc.start()
        write_pairs(tmp_path / "pairs.h5", splits, "category", ATTRIBUTES)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(2)
    few, many = peak(25), peak(100)  # 1.2 and 4.9 MB a split
    assert many - few < 100_000


def test_a_pair_file_has_the_published_layout(tmp_path: Path) -> None:
    write_synthetic(tmp_path / "pairs.h5", "scene")
    with h5py.File(tmp_path / "pairs.h5") as file:
        assert dict(file.attrs) == {
            "scenario": "tiny",
            "unit": "unit sphere",
            "seed": 7,
            "schema": 1,
            "provenance": '{"a": 2, "b": 1}',
        }
        kinds = {name: (file["train"][name].shape, file["train"][name].dtype.str) for name in (
            "source", "target", "T_target_source", "item")}  # fmt: skip
        assert kinds == {
            "source": ((3, 5, 3), "<f4"),
            "target": ((3, 6, 3), "<f4"),
            "T_target_source": ((3, 4, 4), "<f8"),
            "item": ((3,), "<i8"),
        }
        assert sorted(file["test"]) == ["T_target_source", "item", "scene", "source", "target"]


def test_says_how_a_pair_file_was_made(tmp_path: Path) -> None:
    write_synthetic(tmp_path / "pairs.h5")
    assert read_attributes(tmp_path / "pairs.h5") == ATTRIBUTES | {"schema": 1}


@pytest.mark.parametrize("content", [b"", b"text"])
def test_refuses_the_attributes_of_what_is_no_pair_file(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "pairs.h5").write_bytes(content)
    with pytest.raises(ValueError, match=r"pairs\.h5 is not a pair file with a provenance"):
        read_attributes(tmp_path / "pairs.h5")


def test_refuses_the_attributes_of_a_pair_file_that_lost_some(tmp_path: Path) -> None:
    path = tmp_path / "pairs.h5"
    write_synthetic(path)
    with h5py.File(path, "r+") as file:
        file.attrs["provenance"] = "no JSON"
    with pytest.raises(ValueError, match=r"pairs\.h5 is not a pair file with a provenance"):
        read_attributes(path)
    for provenance, said in (
        (7, "is not a pair file with a provenance"),
        (h5py.Empty("S1"), "is not a pair file with a provenance"),
        ("[7]", "needs its provenance as a JSON object"),
    ):
        with h5py.File(path, "r+") as file:
            file.attrs["provenance"] = provenance
        with pytest.raises(ValueError, match=rf"pairs\.h5 {said}"):
            read_attributes(path)
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = [1, 1]
    with pytest.raises(ValueError, match=r"pairs\.h5 needs schema 1, has \[1 1\]"):
        read_attributes(path)
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = 1
        file.attrs["provenance"] = "{}"
        del file.attrs["unit"]
    with pytest.raises(ValueError, match=r"pairs\.h5 is not a pair file .*unit"):
        read_attributes(path)
    with pytest.raises(FileNotFoundError, match=r"gone\.h5, there is none: run preprocess"):
        read_attributes(tmp_path / "gone.h5")


def with_normals(pairs: Pairs) -> Pairs:
    source, target = (nn.functional.normalize(c, dim=-1) for c in (pairs.source, pairs.target))
    return replace(pairs, source_normals=source, target_normals=target)


def write_with_normals(path: Path) -> dict[str, Pairs]:
    splits = {
        name: with_normals(synthetic_pairs(count))
        for name, count in zip(SPLITS, (3, 1, 2), strict=True)
    }
    write_pairs(path, streamed(splits), "category", ATTRIBUTES)
    return splits


def test_normals_come_back_where_there_are_any(tmp_path: Path) -> None:
    splits = write_with_normals(tmp_path / "pairs.h5")
    for name in SPLITS:
        read = read_pairs(tmp_path / "pairs.h5", name)
        for field in ("source", "target", "source_normals", "target_normals"):
            assert torch.equal(getattr(read, field), getattr(splits[name], field))
    with h5py.File(tmp_path / "pairs.h5") as file:
        assert file["test/source_normals"].dtype.str == "<f4"
    write_synthetic(tmp_path / "plain.h5")
    plain = read_pairs(tmp_path / "plain.h5", "test")
    assert plain.source_normals is plain.target_normals is None


def test_shapes_come_back_where_there_are_any_and_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "pairs.h5"
    splits = {name: synthetic_pairs(2) for name in SPLITS}
    shape = torch.rand(2, 9, 3, generator=torch.Generator().manual_seed(0))
    splits["test"] = replace(splits["test"], shape=shape)
    write_pairs(path, streamed(splits), "category", ATTRIBUTES)
    found = read_pairs(path, "test").shape
    assert found is not None
    assert torch.equal(found, shape)
    assert read_pairs(path, "train").shape is None
    for wrong, expected in (
        (shape[:1], r"needs shapes \[2, n, 3\] with n > 0, has \(1, 9, 3\)"),
        (shape * torch.inf, "needs finite values, shape has NaN or infinity"),
    ):
        with h5py.File(path, "r+") as file:
            replaced(file["test"], "shape", wrong.numpy())
        with pytest.raises(ValueError, match=rf"pairs\.h5 test {expected}"):
            read_pairs(path, "test")


def without_target_normals(file: h5py.File) -> None:
    del file["test"]["target_normals"]


def put_into_normals(name: str, value: float) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file["test"][name][1, 2] = value

    return change


def with_fewer_normals(file: h5py.File) -> None:
    replaced(file["test"], "source_normals", file["test"]["source_normals"][:, :4])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (without_target_normals, "needs normals of both clouds or of neither, has source_normals"),
        (with_fewer_normals, "source_normals needs one a point (2, 5, 3), has (2, 4, 3)"),
        (put_into_normals("target_normals", 0.0), "target_normals needs finite vectors of unit"),
        (put_into_normals("source_normals", np.nan), "unit length, pair 1 has another"),
        (put_into_normals("source_normals", 0.6), "unit length, pair 1 has another"),
    ],
)
def test_refuses_normals_that_are_none(
    tmp_path: Path, change: Callable[[h5py.File], None], expected: str
) -> None:
    path = tmp_path / "pairs.h5"
    write_with_normals(path)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ValueError, match=r"pairs\.h5 test") as refused:
        read_pairs(path, "test")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def replaced(group: h5py.Group, name: str, value: Any) -> None:  # noqa: ANN401  what h5py takes
    del group[name]
    group[name] = value


def changed(
    name: str, change: Callable[[np.ndarray[Any, Any]], Any]
) -> Callable[[h5py.File], None]:
    """What changes one dataset of the test split."""

    def apply(file: h5py.File) -> None:
        replaced(file["test"], name, change(file["test"][name][:]))

    return apply


def with_value(index: tuple[int, ...], value: float) -> Callable[[np.ndarray[Any, Any]], Any]:
    def change(values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        values[index] = value
        return values

    return change


def without_label(file: h5py.File) -> None:
    del file["test"]["category"]


def without_split(file: h5py.File) -> None:
    del file["test"]


def without_source(file: h5py.File) -> None:
    del file["test"]["source"]


def without_schema(file: h5py.File) -> None:
    del file.attrs["schema"]


def of_another_schema(file: h5py.File) -> None:
    file.attrs["schema"] = 2


def with_a_dataset_for_a_split(file: h5py.File) -> None:
    del file["test"]
    file["test"] = np.zeros(3)


def with_an_empty_split(file: h5py.File) -> None:
    for name in list(file["test"]):
        replaced(file["test"], name, file["test"][name][:0])


def without_values(name: str) -> Callable[[h5py.File], None]:
    return lambda file: replaced(file["test"], name, h5py.Empty("f4"))


def with_a_group_for(name: str) -> Callable[[h5py.File], None]:
    def apply(file: h5py.File) -> None:
        del file["test"][name]
        file["test"].create_group(name)

    return apply


def with_a_type_numpy_lacks(file: h5py.File) -> None:
    space = h5py.h5s.create_simple((2,))
    del file["test"]["item"]
    h5py.h5d.create(file["test"].id, b"item", h5py.h5t.UNIX_D32LE, space)


def with_more_than_the_file_holds(file: h5py.File) -> None:
    del file["test"]["source"]
    file["test"].create_dataset("source", (2, 10**12, 3), "f4", chunks=(1, 1024, 3))


def with_labels_in_latin1(file: h5py.File) -> None:
    replaced(file["test"], "category", np.array(["caf\xe9".encode("latin-1")] * 2))


MALFORMED: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "another schema": (of_another_schema, "needs schema 1, has 2"),
    "no schema": (without_schema, "needs schema 1, has None"),
    "no split": (without_split, "is not a pair file with a split 'test'"),
    "a dataset for a split": (with_a_dataset_for_a_split, "is not a pair file"),
    "no source": (without_source, "is not a pair file with a split 'test'"),
    "no label": (without_label, "test needs a dataset category or scene"),
    "labels that are numbers": (
        changed("category", lambda v: np.arange(len(v))), "category"),
    "a scalar for the items": (changed("item", lambda _: 3), "item"),
    "text for the clouds": (
        changed("source", lambda v: np.full(v.shape, b"x")), "source"),
    "no values for the items": (without_values("item"), "test needs item as an array"),
    "no values for the clouds": (without_values("source"), "test needs source as an array"),
    "a group for the labels": (with_a_group_for("category"), "test needs category as an array"),
    "a group for the poses": (with_a_group_for("T_target_source"), "needs T_target_source as an"),
    "items of a type that numpy lacks": (with_a_type_numpy_lacks, "is not a pair file with a sp"),
    "a column of items": (changed("item", lambda v: v[:, None]), "one item and category for each"),
    "clouds without points": (changed("target", lambda v: v[:, :0]), "test needs points, and one"),
    "more than the file holds": (with_more_than_the_file_holds, "source to be in its file, which"),
    "labels in Latin-1": (with_labels_in_latin1, "category needs text in UTF-8, has b'caf"),
    "no pairs": (with_an_empty_split, "needs as many of each as of sources (0)"),
    "flat clouds": (
        changed("source", lambda v: v[..., :2]), "needs clouds [P, N, 3] and poses [P, 4, 4]"),
    "one cloud for all": (
        changed("target", lambda v: v[0]), "needs clouds [P, N, 3] and poses [P, 4, 4]"),
    "half poses": (
        changed("T_target_source", lambda v: v[:, :3]), "needs clouds [P, N, 3] and poses"),
    "fewer targets": (changed("target", lambda v: v[:1]), "needs as many of each as of sources"),
    "fewer items": (changed("item", lambda v: v[:1]), "needs as many of each as of sources (2)"),
    "fewer labels": (changed("category", lambda v: v[:1]), "needs as many of each as of sources"),
    "NaN in a source": (
        changed("source", with_value((1, 2, 0), np.nan)), "source has NaN or infinity"),
    "infinity in a target": (
        changed("target", with_value((1, 2, 0), np.inf)), "target has NaN or infinity"),
    "NaN in a pose": (
        changed("T_target_source", with_value((0, 0, 3), np.nan)), "pose has NaN or infinity"),
    "a pose that scales": (
        changed("T_target_source", with_value((1, 2, 2), 1.01)), "rigid poses, pair 1 has another"),
    "a pose that mirrors": (
        changed("T_target_source", with_value((1, 2, 2), -1.0)), "rigid poses, pair 1 has another"),
    "a pose that projects": (
        changed("T_target_source", with_value((0, 3, 0), 0.1)), "rigid poses, pair 0 has another"),
}  # fmt: skip
"""What is done to the test split of a pair file, and what has to be said of it."""


@pytest.mark.parametrize("name", MALFORMED)
def test_refuses_pairs_with(tmp_path: Path, name: str) -> None:
    change, expected = MALFORMED[name]
    path = tmp_path / "pairs.h5"
    write_synthetic(path)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ValueError, match=r"pairs\.h5") as refused:
        read_pairs(path, "test")
    said = str(refused.value)
    assert said.startswith(str(path))
    assert expected in said
    assert "\n" not in said


def test_the_other_splits_of_a_malformed_file_are_read(tmp_path: Path) -> None:
    write_synthetic(tmp_path / "pairs.h5")
    with h5py.File(tmp_path / "pairs.h5", "r+") as file:
        without_label(file)
    assert len(read_pairs(tmp_path / "pairs.h5", "train")) == 3


@pytest.mark.parametrize("length", [0, 100, 2000])
def test_refuses_a_pair_file_that_was_cut(tmp_path: Path, length: int) -> None:
    path = tmp_path / "pairs.h5"
    write_synthetic(path)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match=r"pairs\.h5 is not a pair file") as refused:
        read_pairs(path, "test")
    assert "\n" not in str(refused.value)


def test_says_where_a_pair_file_is_missing_and_what_makes_it(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"pairs\.h5, there is none: run preprocess"):
        read_pairs(tmp_path / "pairs.h5", "test")


# Weights and curves.


def test_weights_come_back_with_the_same_bytes_twice(tmp_path: Path) -> None:
    weights = {"b.weight": torch.randn(3, 4).mT, "a": torch.tensor(2)}
    for name in ("a", "b"):
        facts = {"method": "pcrdiffusion_cf", "z": 1, "epochs": 3}
        write_weights(tmp_path / f"{name}.safetensors", weights, facts)
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()
    read = read_weights(tmp_path / "a.safetensors", "pcrdiffusion_cf")
    assert read.keys() == weights.keys()
    assert all(torch.equal(read[name], weights[name]) for name in weights)


def test_refuses_the_weights_of_another_method(tmp_path: Path) -> None:
    path = tmp_path / "a.safetensors"
    write_weights(path, {"a": torch.ones(1)}, {"method": "pcrdiffusion_cf"})
    with pytest.raises(ValueError, match=r"a\.safetensors needs weights of x, has pcrdiffusion_cf"):
        read_weights(path, "x")


def test_refuses_weights_of_nobody(tmp_path: Path) -> None:
    save_file({"a": torch.ones(1)}, tmp_path / "a.safetensors")
    with pytest.raises(ValueError, match=r"a\.safetensors needs weights of x, has None"):
        read_weights(tmp_path / "a.safetensors", "x")


@pytest.mark.parametrize("facts", ["not JSON", "[1, 2]"])
def test_refuses_weights_whose_facts_are_no_record(tmp_path: Path, facts: str) -> None:
    save_file({"a": torch.ones(1)}, tmp_path / "a.safetensors", metadata={"facts": facts})
    with pytest.raises(ValueError, match=r"a\.safetensors") as refused:
        read_weights(tmp_path / "a.safetensors", "x")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kept", [0, 7, -1])
def test_refuses_weights_that_were_cut(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "a.safetensors"
    write_weights(path, {"a": torch.ones(100)}, {"method": "x"})
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ValueError, match=r"a\.safetensors is not a safetensors file") as refused:
        read_weights(path, "x")
    assert "\n" not in str(refused.value)


def test_says_where_weights_are_missing_and_what_makes_them(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"a\.safetensors, there are none: run train"):
        read_weights(tmp_path / "a.safetensors", "x")


def test_a_curve_has_a_row_an_epoch_and_is_empty_where_nothing_was_validated(
    tmp_path: Path,
) -> None:
    losses = {"loss": 1.5, "pose": 0.5}
    curve = [Epoch(0, 4, 0.1, losses, None, None), Epoch(1, 8, 0.05, losses, 30.0, 0.25)]
    write_curve(tmp_path / "curve.csv", curve)
    assert (tmp_path / "curve.csv").read_bytes() == (
        b"epoch,step,learning_rate,loss,pose,val_error_r_deg,val_error_t\n"
        b"0,4,0.1,1.5,0.5,,\n"
        b"1,8,0.05,1.5,0.5,30.0,0.25\n"
    )


def test_a_term_stays_in_its_column_when_a_resumed_training_lists_it_elsewhere(
    tmp_path: Path,
) -> None:
    losses = [
        {"loss": 1.5, "pose": 0.5, "chamfer": 1.0},
        {"chamfer": 1.1, "loss": 1.7, "pose": 0.6},
    ]
    curve = [Epoch(k, k, 0.1, terms, None, None) for k, terms in enumerate(losses)]
    write_curve(tmp_path / "curve.csv", curve)
    rows = read_rows(tmp_path / "curve.csv")
    for row, terms in zip(rows, losses, strict=True):
        assert {name: float(row[name]) for name in terms} == terms
    write_curve(tmp_path / "other.csv", curve[::-1])
    assert list(read_rows(tmp_path / "other.csv")[0]) == list(rows[0])


# Answers.


def read_rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def identities(count: int, failures: tuple[str, ...]) -> Estimates:
    return Estimates(torch.eye(4, dtype=torch.float64).repeat(count, 1, 1), failures)


def test_an_answer_is_a_row_a_pair_with_errors_worked_by_hand(tmp_path: Path) -> None:
    truth = synthetic_pairs(2)  # a quarter turn about z, and the same with 0.1 along x
    write_estimates(tmp_path / "a.csv", truth, {"paper": identities(2, ("", "no, it failed"))})
    rows = read_rows(tmp_path / "a.csv")
    assert list(rows[0]) == [*ANSWER, CHAMFER, *JUDGED]
    assert {row[name] for row in rows for name in (CHAMFER, *JUDGED)} == {""}
    assert [(r["pair"], r["item"], r["group"], r["setting"], r["failure"]) for r in rows] == [
        ("0", "10", "group 0", "paper", ""),
        ("1", "11", "group 1", "paper", "no, it failed"),
    ]
    assert [float(r["error_r_deg"]) for r in rows] == pytest.approx([90.0, 90.0])
    assert [float(r["error_t"]) for r in rows] == pytest.approx([0.0, 0.1])
    assert [abs(float(rows[1][axis])) for axis in ("rx_deg", "ry_deg", "rz_deg")] == pytest.approx(
        [0.0, 0.0, 90.0]
    )
    assert [abs(float(rows[1][axis])) for axis in ("tx", "ty", "tz")] == pytest.approx([0.1, 0, 0])
    pose = [[float(rows[0][f"T{row}{column}"]) for column in range(4)] for row in range(3)]
    assert pose == np.eye(4)[:3].tolist()


def test_a_pair_whose_shape_is_known_tells_how_far_the_clouds_lie_from_it(tmp_path: Path) -> None:
    truth = synthetic_pairs(2)
    noisy = replace(truth, shape=truth.source + 0.01)
    right = Estimates(truth.T_target_source, ("", ""))
    write_estimates(tmp_path / "a.csv", noisy, {"right": right, "wrong": identities(2, ("", ""))})
    ratios = [float(row[CHAMFER]) for row in read_rows(tmp_path / "a.csv")]
    assert ratios[:2] == pytest.approx([1, 1])
    assert min(ratios[2:]) > 1.1


def test_answers_of_several_settings_follow_each_other(tmp_path: Path) -> None:
    given = {"paper": identities(2, ("", "")), "official": identities(2, ("", ""))}
    write_estimates(tmp_path / "a.csv", synthetic_pairs(2), given)
    rows = read_rows(tmp_path / "a.csv")
    assert [(row["setting"], row["pair"]) for row in rows] == [
        ("paper", "0"), ("paper", "1"), ("official", "0"), ("official", "1"),
    ]  # fmt: skip


def test_the_same_answers_give_the_same_bytes_with_plain_line_ends(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv"):
        write_estimates(tmp_path / name, synthetic_pairs(2), {"paper": identities(2, ("", ""))})
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert b"\r" not in (tmp_path / "a.csv").read_bytes()


def test_a_pose_comes_back_from_its_row_to_the_last_bit(tmp_path: Path) -> None:
    angle = torch.tensor(0.1, dtype=torch.float64)
    T_target_source = torch.eye(4, dtype=torch.float64)
    T_target_source[0, 0], T_target_source[0, 3] = angle.cos(), 1 / 3
    write_estimates(
        tmp_path / "a.csv", synthetic_pairs(1), {"paper": Estimates(T_target_source[None], ("",))}
    )
    (row,) = read_rows(tmp_path / "a.csv")
    assert float(row["T00"]) == angle.cos().item()
    assert float(row["T03"]) == 1 / 3


def test_what_speaks_for_an_answer_stands_behind_it_and_nothing_where_there_is_none(
    tmp_path: Path,
) -> None:
    evidence = torch.arange(12, dtype=torch.float64).reshape(2, 6) / 12
    evidence[1] = torch.nan
    known = replace(identities(2, ("", "it failed")), evidence=evidence)
    zeros = (0.0,) * 6
    verdict = Verdict(zeros, (1.0,) * 6, (12.0, *zeros[1:5], 12.0), -5.0, None, 9, 8)
    given = {"paper": known, "official": known, "other": identities(2, ("", ""))}
    write_estimates(tmp_path / "a.csv", synthetic_pairs(2), given, {"official": verdict})
    rows = [[row[name] for name in JUDGED] for row in read_rows(tmp_path / "a.csv")]
    numbers = [repr(k / 12) for k in range(6)]
    assert rows == [
        [*numbers, ""], [""] * 7, [*numbers, "0.5"], [""] * 7, [""] * 7, [""] * 7,
    ]  # fmt: skip
    write_ablation(tmp_path / "b.csv", synthetic_pairs(2), {"cb": {"paper": known}})
    assert [read_rows(tmp_path / "b.csv")[0][name] for name in JUDGED] == [*numbers, ""]


def test_an_ablation_names_the_method_of_each_row(tmp_path: Path) -> None:
    one = identities(1, ("",))
    answers = {"cf": {"steps=1": one, "steps=2": one}, "cb": {"steps=1": one}}
    write_ablation(tmp_path / "a.csv", synthetic_pairs(1), answers)
    rows = read_rows(tmp_path / "a.csv")
    assert list(rows[0]) == ["method", *ANSWER, CHAMFER, *JUDGED]
    assert [(r["method"], r["setting"]) for r in rows] == [
        ("cf", "steps=1"), ("cf", "steps=2"), ("cb", "steps=1"),
    ]  # fmt: skip
