"""What the readers list: official names of one data set, and every folder or none."""

import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from pcrdiff.datasets import kitti, modelnet40, threedmatch
from pcrdiff.datasets.items import RawItem

Read = Callable[[Path], list[RawItem]]
READERS: dict[str, Read] = {
    "modelnet40": modelnet40.read_items,
    "3dmatch": threedmatch.read_items,
    "kitti": kitti.read_items,
}


def touch(root: Path, *places: str) -> None:
    for place in places:
        path = root / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")


def write_hdf5(folder: Path, train: str = "ply_data_train0.h5") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "shape_names.txt").write_text("bed\n")
    for split, name in (("train", train), ("test", "ply_data_test0.h5")):
        (folder / f"{split}_files.txt").write_text(f"somewhere/{name}\n")
        with h5py.File(folder / name, "w") as file:
            file["data"], file["label"] = np.zeros((1, 5, 3), np.float32), np.zeros(1, np.uint8)


def write_resampled(folder: Path, name: str = "bed_0001") -> None:
    touch(folder, f"bed/{name}.txt", "bed/bed_0002.txt")
    (folder / "modelnet40_train.txt").write_text(f"{name}\n")
    (folder / "modelnet40_test.txt").write_text("bed_0002\n")


def names(items: list[RawItem]) -> list[str]:
    return [item.name for item in items]


GOOD = {
    "modelnet40": ("bed/test/bed_0002.off", "bed/train/bed_0001.off", "chair/train/chair_0001.off"),
    "3dmatch": ("kitchen/cloud_bin_2.ply", "kitchen/cloud_bin_10.ply", "study/cloud_bin_0.ply"),
    "kitti": tuple(
        f"sequences/{name}.bin" for name in ("00/velodyne/000001", "07/velodyne/000000")
    ),
}
"""Places of each data set in the order in which they are listed."""
LISTED = {
    "modelnet40": ["bed_0002", "bed_0001", "chair_0001"],
    "3dmatch": ["kitchen/cloud_bin_2", "kitchen/cloud_bin_10", "study/cloud_bin_0"],
    "kitti": ["00/000001", "07/000000"],
}


# More than one candidate.


@pytest.mark.parametrize("first", ["", "ModelNet10"])
@pytest.mark.parametrize("second", ["ModelNet40", "modelnet40_normal_resampled"])
def test_refuses_to_choose_between_two_data_sets_and_lists_both(
    tmp_path: Path, first: str, second: str
) -> None:
    touch(tmp_path / first, "bed/train/bed_0001.off")
    if second == "ModelNet40":
        touch(tmp_path / second, "bed/train/bed_0001.off", "car/train/car_0001.off")
    else:
        write_resampled(tmp_path / second)
    with pytest.raises(ValueError, match="holds 2: ") as refusal:
        modelnet40.read_items(tmp_path)
    assert f"in {tmp_path / first};" in str(refusal.value)
    assert f"in {tmp_path / second};" in str(refusal.value)


def test_refuses_to_choose_between_layouts_in_one_folder(tmp_path: Path) -> None:
    touch(tmp_path, "bed/train/bed_0001.off")
    write_hdf5(tmp_path)
    with pytest.raises(ValueError, match=f"meshes in {tmp_path}; HDF5 files in {tmp_path};"):
        modelnet40.read_items(tmp_path)
    write_resampled(tmp_path)
    with pytest.raises(ValueError, match=f"holds 3: .*; resampled clouds in {tmp_path};"):
        modelnet40.read_items(tmp_path)


def test_refuses_to_choose_between_the_two_places_of_sequences(tmp_path: Path) -> None:
    touch(tmp_path, *GOOD["kitti"])
    touch(tmp_path / "dataset", *GOOD["kitti"])
    for read in (kitti.read_items, kitti.read_recorded_pairs):
        with pytest.raises(ValueError, match="holds 2: ") as refusal:
            read(tmp_path)
        assert f"in {tmp_path}/sequences; " in str(refusal.value)
        assert f"in {tmp_path}/dataset/sequences;" in str(refusal.value)


def test_a_link_to_the_same_data_set_is_no_second_one(tmp_path: Path) -> None:
    touch(tmp_path / "meshes" / "ModelNet40", *GOOD["modelnet40"])
    (tmp_path / "meshes" / "latest").symlink_to("ModelNet40")
    (tmp_path / "meshes" / "self").symlink_to(".")
    assert names(modelnet40.read_items(tmp_path / "meshes")) == LISTED["modelnet40"]
    touch(tmp_path / "scans", *GOOD["kitti"])
    (tmp_path / "scans" / "dataset").symlink_to(".")
    assert names(kitti.read_items(tmp_path / "scans")) == LISTED["kitti"]


# Folders that cannot be listed.


@pytest.fixture
def shut(monkeypatch: pytest.MonkeyPatch) -> Callable[[Path, int], None]:
    """Let listing one folder fail, as it does without permission or on a mount that is gone."""
    listing = Path.iterdir

    def shut(folder: Path, number: int) -> None:
        def iterdir(self: Path) -> Iterator[Path]:
            if self == folder:
                raise OSError(number, os.strerror(number), str(self))
            return listing(self)

        monkeypatch.setattr(Path, "iterdir", iterdir)

    return shut


@pytest.mark.parametrize("number", [errno.EACCES, errno.EIO, errno.ESTALE])
@pytest.mark.parametrize(
    ("family", "folder"),
    [
        ("modelnet40", "."),
        ("modelnet40", "bed"),
        ("modelnet40", "chair/train"),
        ("3dmatch", "."),
        ("3dmatch", "study"),
        ("kitti", "sequences"),
        ("kitti", "sequences/07"),
        ("kitti", "sequences/07/velodyne"),
    ],
)
def test_a_folder_that_cannot_be_listed_stops_the_reader_by_its_name(
    tmp_path: Path, shut: Callable[[Path, int], None], family: str, folder: str, number: int
) -> None:
    touch(tmp_path, *GOOD[family])
    shut(tmp_path / folder, number)
    with pytest.raises(OSError, match=f"{tmp_path / folder} cannot be listed: "):
        READERS[family](tmp_path)


def test_an_evaluation_folder_that_cannot_be_found_stops_the_reader_of_pairs(
    tmp_path: Path, shut: Callable[[Path, int], None]
) -> None:
    touch(tmp_path, *GOOD["3dmatch"], "kitchen-evaluation/gt.log")
    shut(tmp_path, errno.EACCES)
    with pytest.raises(PermissionError, match=f"{tmp_path} cannot be listed: "):
        threedmatch.read_recorded_pairs(tmp_path)


@pytest.mark.parametrize(
    ("family", "link"),
    [("modelnet40", "car"), ("3dmatch", "office"), ("kitti", "sequences/01")],
)
def test_a_link_that_leads_nowhere_stops_the_reader(tmp_path: Path, family: str, link: str) -> None:
    touch(tmp_path, *GOOD[family])
    (tmp_path / link).symlink_to(tmp_path / "unmounted")
    with pytest.raises(FileNotFoundError, match=f"{tmp_path / link} cannot be read: No such file"):
        READERS[family](tmp_path)


# Names.


@pytest.mark.parametrize(
    ("family", "place"),
    [
        ("modelnet40", "bed/train/bed_0001 (1).off"),
        ("modelnet40", "bed/train/bed_001.off"),
        ("modelnet40", "bed/train/bed_00010.off"),
        ("modelnet40", "bed/test/chair_0001.off"),
        ("modelnet40", "bed/train/bed_\u0660\u0660\u0660\u0661.off"),
        ("modelnet40", "bed/train/Copy of bed_0001.off"),
        ("modelnet40", "bed/train/bed_0003.OFF"),
        ("3dmatch", "study/cloud_bin_0 (1).ply"),
        ("3dmatch", "study/cloud_bin_01.ply"),
        ("3dmatch", "study/cloud_bin_\u0663.ply"),
        ("3dmatch", "study/cloud_bin_\u00b2.ply"),
        ("3dmatch", "study/cloud_bin_-1.ply"),
        ("3dmatch", "study/Cloud_bin_1.ply"),
        ("3dmatch", "study/cloud_bin_1.PLY"),
        ("kitti", "sequences/00/velodyne/000001 (1).bin"),
        ("kitti", "sequences/00/velodyne/1.bin"),
        ("kitti", "sequences/00/velodyne/0000001.bin"),
        ("kitti", "sequences/00/velodyne/000001 copy.bin"),
        ("kitti", "sequences/00/velodyne/000001.bin.1"),
        ("kitti", "sequences/00/velodyne/\u0660\u0660\u0660\u0660\u0660\u0661.bin"),
        ("kitti", "sequences/00/velodyne/000002\n.bin"),
        ("kitti", "sequences/00/velodyne/000002.BIN"),
    ],
)
def test_refuses_a_file_whose_name_is_not_the_data_sets_and_quotes_it(
    tmp_path: Path, family: str, place: str
) -> None:
    touch(tmp_path, *GOOD[family], place)
    with pytest.raises(ValueError, match="needs names like") as refusal:
        READERS[family](tmp_path)
    assert repr(Path(place).name) in str(refusal.value)
    assert str((tmp_path / place).parent) in str(refusal.value)


@pytest.mark.parametrize("name", ["0a", "0", "000", "00 (1)", "\u0660\u0661", "00_old"])
def test_refuses_a_sequence_whose_name_is_not_two_digits(tmp_path: Path, name: str) -> None:
    touch(tmp_path, *GOOD["kitti"], f"sequences/{name}/velodyne/000000.bin")
    for read in (kitti.read_items, kitti.read_recorded_pairs):
        with pytest.raises(ValueError, match="sequences needs names like 00, got ") as refusal:
            read(tmp_path)
        assert repr(name) in str(refusal.value)


@pytest.mark.parametrize("name", ["Velodyne", "velodyne_points", "velodyne (1)"])
def test_refuses_a_sequence_whose_scans_lie_elsewhere(tmp_path: Path, name: str) -> None:
    touch(tmp_path, *GOOD["kitti"], f"sequences/01/{name}/000000.bin")
    with pytest.raises(ValueError, match="01 needs names like velodyne, got ") as refusal:
        kitti.read_items(tmp_path)
    assert repr(name) in str(refusal.value)


@pytest.mark.parametrize("place", ["bed", "bed/Train", "bed/train (1)", "bed/val"])
def test_refuses_meshes_that_lie_in_neither_split(tmp_path: Path, place: str) -> None:
    touch(tmp_path, *GOOD["modelnet40"], f"{place}/bed_0003.off")
    with pytest.raises(ValueError, match=r"needs to lie in .*bed/train or .*bed/test") as refusal:
        modelnet40.read_items(tmp_path)
    assert str(tmp_path / place / "bed_0003.off") in str(refusal.value)


def test_refuses_a_copy_of_a_category_and_of_an_evaluation_folder(tmp_path: Path) -> None:
    touch(tmp_path / "meshes", *GOOD["modelnet40"], "bed (1)/train/bed_0001.off")
    with pytest.raises(ValueError, match=r"needs categories of ModelNet40, got 'bed \(1\)'"):
        modelnet40.read_items(tmp_path / "meshes")
    touch(tmp_path / "rooms", *GOOD["3dmatch"], "study-evaluation (1)/gt.log")
    with pytest.raises(ValueError, match=r"<scene>-evaluation, got 'study-evaluation \(1\)'"):
        threedmatch.read_recorded_pairs(tmp_path / "rooms")


def test_refuses_names_in_a_list_that_are_not_official(tmp_path: Path) -> None:
    write_hdf5(tmp_path / "hdf5", "ply_data_train0 (1).h5")
    with pytest.raises(ValueError, match=r"like ply_data_train0\.h5, got 'ply_data_train0 \(1\)"):
        modelnet40.read_items(tmp_path / "hdf5")
    write_resampled(tmp_path / "clouds", "bed_0001 (1)")
    with pytest.raises(ValueError, match=r"like bed_0001\.txt, got 'bed_0001 \(1\)\.txt'"):
        modelnet40.read_items(tmp_path / "clouds")


def test_a_sentence_quotes_a_few_of_many_names(tmp_path: Path) -> None:
    touch(tmp_path, *(f"study/cloud_bin_0{number}.ply" for number in range(9)))
    with pytest.raises(ValueError, match=r"'cloud_bin_04\.ply' and 4 more: rename or remove"):
        threedmatch.read_items(tmp_path)


LITTER = {
    "modelnet40": ["bed/train/{}", "bed/{}", "{}"],
    "3dmatch": ["study/{}", "{}"],
    "kitti": ["sequences/00/velodyne/{}", "sequences/00/{}", "sequences/{}", "{}"],
}


@pytest.mark.parametrize("family", LITTER)
def test_what_systems_and_editors_leave_is_no_part_of_the_data_set(
    tmp_path: Path, family: str
) -> None:
    touch(tmp_path, *GOOD[family])
    name = Path(GOOD[family][0]).name
    left = [f"._{name}", f".{name}.swp", f"{name}~", f"#{name}#", f"{name}.bak", ".DS_Store"]
    left += ["Thumbs.db", "README.md", "LICENSE", ".ipynb_checkpoints/x"]
    touch(tmp_path, *(place.format(each) for place in LITTER[family] for each in left))
    assert names(READERS[family](tmp_path)) == LISTED[family]


def test_known_companions_are_no_part_of_what_is_listed(tmp_path: Path) -> None:
    touch(tmp_path / "rooms", *GOOD["3dmatch"], "study/cloud_bin_0.info.txt")
    touch(tmp_path / "rooms", "study-evaluation/gt.log", "study-evaluation/gt.info")
    assert names(threedmatch.read_items(tmp_path / "rooms")) == LISTED["3dmatch"]
    touch(tmp_path / "scans", *GOOD["kitti"], "poses/00.txt", "sequences/00/labels/000001.label")
    beside = ("times.txt", "calib.txt", "poses.txt", "image_2/000001.png", "voxels/000001.bin")
    touch(tmp_path / "scans", *(f"sequences/{n}/{each}" for n in ("00", "12") for each in beside))
    assert names(kitti.read_items(tmp_path / "scans")) == LISTED["kitti"]
