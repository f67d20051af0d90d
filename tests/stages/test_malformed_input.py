"""What is malformed is refused: one sentence with the file, exit code 1, nothing half-written."""

import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pcrdiff.clouds.off import read_off
from pcrdiff.datasets import kitti, threedmatch
from tests.tiny import (
    CB,
    CF,
    PAIRS,
    SCENARIO,
    files_below,
    instance,
    refusal,
    run_instance,
    tiny_params,
    weights,
    write_box,
    write_params,
)

BY_ITEM = {"by": "item", "categories": "all", "val_fraction": 0.34, "test_fraction": 0.34}
BY_ITEM |= {"val_groups": [], "test_groups": []}
PREPROCESS = instance(f"preprocess@{SCENARIO}").argv
TRAIN = instance(f"train@{SCENARIO}-{CF}").argv
EVALUATE = instance(f"evaluate@{CF}").argv


def use_local(family: str, root: str, split: dict[str, Any] | None = None) -> None:
    """Let the scenario be made of a local folder, and acquire that."""
    params = tiny_params()
    params["acquire"]["modelnet40"] |= {"family": family, "root": root}
    if split is not None:
        params["scenarios"][SCENARIO]["split"] = split
    write_params(params)
    run_instance(instance("acquire@modelnet40"))


def assert_refused(stage: str, argv: list[str], *expected: str) -> None:
    """One sentence with all that is expected; no output, whole or half, is there afterwards."""
    before = outputs()
    said = refusal(stage, argv)
    for part in expected:
        assert part in said
    assert outputs() == before


def outputs() -> dict[str, bytes]:
    """All files below the folders that stages write to, hidden ones too."""
    folders = (Path(name) for name in ("data", "models", "results"))
    files = (file for folder in folders for file in sorted(folder.rglob("*")) if file.is_file())
    return {file.as_posix(): file.read_bytes() for file in files}


def write_scans(folder: Path, spoil: Callable[[Path], object] = lambda _: None) -> None:
    """Write three KITTI scans of 60 points, and spoil the first."""
    velodyne = folder / "sequences" / "00" / "velodyne"
    velodyne.mkdir(parents=True)
    generator = np.random.default_rng(3)
    for number in range(3):
        points = generator.uniform([-20, -20, -3, 0], [20, 20, 3, 1], (60, 4)).astype("<f4")
        (velodyne / f"{number:06d}.bin").write_bytes(points.tobytes())
    spoil(velodyne / "000000.bin")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5])


def put_nan(path: Path) -> None:
    path.write_bytes(struct.pack("<f", float("nan")) + path.read_bytes()[4:])


def save_as_float64(path: Path) -> None:
    path.write_bytes(np.fromfile(path, "<f4").astype("<f8").tobytes())


def drop_reflectance(path: Path) -> None:
    path.write_bytes(np.fromfile(path, "<f4").reshape(-1, 4)[:, :3].tobytes())


def empty(path: Path) -> None:
    path.write_bytes(b"")


# Raw data.


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (cut, "needs 16 bytes per point"),
        (put_nan, "needs finite coordinates, 1 of its 60 points"),
        (empty, "needs points as [n, 3] with n > 0"),
        (save_as_float64, "it looks like float64 x, y, z, reflectance"),
        (drop_reflectance, "it looks like float32 x, y, z"),
    ],
)
def test_a_spoilt_scan(blank: Path, spoil: Callable[[Path], None], expected: str) -> None:
    write_scans(blank / "scans", spoil)
    use_local("kitti", "scans", BY_ITEM)
    assert_refused("preprocess", PREPROCESS, "000000.bin", expected)
    assert files_below(PAIRS.parent) == []


def test_a_scan_with_too_few_points(blank: Path) -> None:
    write_scans(blank / "scans", lambda path: path.write_bytes(path.read_bytes()[:160]))
    use_local("kitti", "scans", BY_ITEM)
    assert_refused("preprocess", PREPROCESS, "00/000000", "needs 48 points, the cloud has 10")


def test_an_old_pair_file_stays_when_a_new_one_cannot_be_made(project: Path) -> None:
    before = (project / PAIRS).read_bytes()
    write_scans(project / "scans", put_nan)
    use_local("kitti", "scans", BY_ITEM)
    assert_refused("preprocess", PREPROCESS, "000000.bin", "needs finite coordinates")
    assert (project / PAIRS).read_bytes() == before


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("8 6 0\n0 0 0\n", "needs to begin with OFF"),
        ("OFF\n8 6 0\n0 0 0\n", "needs 8 vertices and 6 faces as its header says"),
        (
            "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n",
            "line 5, needs vertices `x y z` of finite numbers",
        ),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 1.#QNAN\n3 0 1 2\n", "line 5, needs vertices"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n", "needs a mesh with area"),
        ("", "needs to begin with OFF"),
    ],
)
def test_a_spoilt_mesh(blank: Path, text: str, expected: str) -> None:
    (blank / "boxes" / "bed" / "train" / "bed_0001.off").write_text(text)
    run_instance(instance("acquire@modelnet40"))
    assert_refused("preprocess", PREPROCESS, "bed_0001", expected)
    assert files_below(PAIRS.parent) == []


def test_a_fused_header_is_read(blank: Path) -> None:
    path = blank / "boxes" / "bed" / "train" / "bed_0001.off"
    plain = path.read_text()
    path.write_text(plain.replace("OFF\n", "OFF", 1))
    run_instance(instance("acquire@modelnet40"))
    run_instance(instance(f"preprocess@{SCENARIO}"))
    assert PAIRS.is_file()


def test_a_folder_of_another_family(blank: Path) -> None:
    use_local("3dmatch", "boxes", BY_ITEM)
    assert_refused("preprocess", PREPROCESS, "boxes", "3DMatch needs <scene>/cloud_bin_0.ply")
    assert blank.is_dir()


def test_a_category_that_is_none(blank: Path) -> None:
    write_box(blank / "boxes" / "dragon" / "train" / "dragon_0001.off", [1, 1, 1])
    run_instance(instance("acquire@modelnet40"))
    assert_refused("preprocess", PREPROCESS, "boxes", "categories of ModelNet40, got 'dragon'")


def test_a_data_set_without_a_manifest(blank: Path) -> None:
    assert_refused("preprocess", PREPROCESS, "data/raw/modelnet40/manifest.json")
    assert not (blank / "data" / "pairs").exists()


def test_a_manifest_that_was_cut(project: Path) -> None:
    cut(project / "data" / "raw" / "modelnet40" / "manifest.json")
    assert_refused("preprocess", PREPROCESS, "manifest.json needs to be JSON")


def write_hdf5(folder: Path, points: object, labels: object) -> None:
    """Write ModelNet's HDF5 layout."""
    folder.mkdir()
    (folder / "shape_names.txt").write_text("bed\nchair\n")
    for split in ("train", "test"):
        (folder / f"{split}_files.txt").write_text(f"ply_data_{split}0.h5\n")
        with h5py.File(folder / f"ply_data_{split}0.h5", "w") as file:
            file["data"], file["label"] = points, labels


CLOUDS = np.random.default_rng(1).uniform(-1, 1, (4, 60, 3)).astype(np.float32)
LABELS = np.array([[0], [1], [0], [1]], np.uint8)


def with_nan() -> np.ndarray[Any, Any]:
    clouds = CLOUDS.copy()
    clouds[1, 2, 0] = np.nan
    return clouds


@pytest.mark.parametrize(
    ("clouds", "labels", "expected"),
    [
        (CLOUDS[..., :2], LABELS, "needs `data` as floats [shapes, points, 3]"),
        (CLOUDS[0], LABELS, "needs `data` as floats [shapes, points, 3]"),
        (CLOUDS.astype(int), LABELS, "needs `data` as floats [shapes, points, 3]"),
        (CLOUDS, LABELS[:2], "needs `label` as 4 integers"),
        (CLOUDS, LABELS.astype(float), "needs `label` as 4 integers"),
        (CLOUDS, LABELS + 7, "label"),
        (with_nan(), LABELS, "needs finite coordinates"),
    ],
)
def test_modelnet_s_hdf5_with_another_content(
    blank: Path, clouds: object, labels: object, expected: str
) -> None:
    write_hdf5(blank / "hdf5", clouds, labels)
    use_local("modelnet40", "hdf5")
    assert_refused("preprocess", PREPROCESS, "ply_data_", expected)


@pytest.mark.parametrize("content", [b"", b"text"])
def test_modelnet_s_hdf5_that_is_none(blank: Path, content: bytes) -> None:
    write_hdf5(blank / "hdf5", CLOUDS, LABELS)
    (blank / "hdf5" / "ply_data_train0.h5").write_bytes(content)
    use_local("modelnet40", "hdf5")
    assert_refused("preprocess", PREPROCESS, "ply_data_train0.h5 needs to be HDF5 with `data`")


# Recorded pairs, as the library reads them: one sentence with the file.


BLOCK = "0\t1\t2\n1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


def write_log(folder: Path, text: str) -> Path:
    for number in range(2):
        path = folder / "room" / f"cloud_bin_{number}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("ply\n")
    (folder / "room-evaluation").mkdir()
    (folder / "room-evaluation" / "gt.log").write_text(text)
    return folder


def test_a_whole_log_is_read(tmp_path: Path) -> None:
    (pair,) = threedmatch.read_recorded_pairs(write_log(tmp_path, BLOCK))
    assert (pair.source, pair.target) == ("room/cloud_bin_1", "room/cloud_bin_0")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BLOCK + BLOCK[: len(BLOCK) // 2], "needs blocks of 5 lines"),
        (BLOCK.removesuffix("0 0 0 1\n") + "0 0\n", "line 5, needs 4 numbers, a row of a 4x4 pose"),
        ("", "needs blocks of 5 lines"),
        (BLOCK.replace("1 0 0 0.5", "2 0 0 0.5"), "needs a rigid pose"),
        (BLOCK.replace("1 0 0 0.5", "-1 0 0 0.5"), "needs a rigid pose"),
        (BLOCK.replace("0.5", "nan"), "line 2, needs a pose of finite numbers"),
        (BLOCK.replace("0\t1\t2", "0\t7\t2"), "names fragment 7"),
    ],
)
def test_a_spoilt_log(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises((ValueError, FileNotFoundError), match=r"gt\.log") as refused:
        threedmatch.read_recorded_pairs(write_log(tmp_path, text))
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def write_drive(folder: Path) -> Path:
    """Write scans with poses and a calibration, each scan 12 m after the last."""
    write_scans(folder)
    eye = "1 0 0 {} 0 1 0 0 0 0 1 0\n"
    (folder / "poses").mkdir()
    (folder / "poses" / "00.txt").write_text("".join(eye.format(12 * k) for k in range(3)))
    (folder / "sequences" / "00" / "calib.txt").write_text(f"P0: 1\nTr: {eye.format(0)}")
    return folder


def test_a_whole_drive_is_read(tmp_path: Path) -> None:
    pairs = kitti.read_recorded_pairs(write_drive(tmp_path / "kitti"))
    assert [(p.source, p.target) for p in pairs] == [
        ("00/000000", "00/000001"),
        ("00/000001", "00/000002"),
    ]


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("sequences/00/calib.txt", None, "calibration"),
        ("poses/00.txt", None, "needs the poses"),
        ("sequences/00/calib.txt", lambda text: text.replace("Tr:", "R0:"), "needs a line `Tr:`"),
        ("sequences/00/calib.txt", lambda text: text[:-4], "needs 12 numbers"),
        ("poses/00.txt", lambda text: text.splitlines()[0], "needs a pose for scan 000002"),
        ("poses/00.txt", lambda text: text.replace("1 0 0 12", "3 0 0 12"), "needs a rigid pose"),
    ],
)
def test_a_spoilt_drive(
    tmp_path: Path, name: str, change: Callable[[str], str] | None, expected: str
) -> None:
    path = write_drive(tmp_path / "kitti") / name
    if change is None:
        path.unlink()
    else:
        path.write_text(change(path.read_text()))
    with pytest.raises((ValueError, FileNotFoundError), match=path.name) as refused:
        kitti.read_recorded_pairs(tmp_path / "kitti")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


# Pair files.


def put_into(name: str, index: tuple[int, ...], value: float) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        for split in ("train", "test"):
            values = file[split][name][:]
            values[index] = value
            file[split][name][:] = values

    return change


def another_schema(file: h5py.File) -> None:
    file.attrs["schema"] = 2


def no_poses(file: h5py.File) -> None:
    for split in ("train", "test"):
        del file[split]["T_target_source"]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (another_schema, "needs schema 1, has 2"),
        (no_poses, "is not a pair file"),
        (put_into("source", (0, 0, 0), np.nan), "source has NaN or infinity"),
        (put_into("T_target_source", (1, 0, 0), 2.0), "needs rigid poses, pair 1 has another"),
    ],
)
@pytest.mark.parametrize(("stage", "argv"), [("train", TRAIN), ("evaluate", EVALUATE)])
def test_a_spoilt_pair_file(
    project: Path,
    stage: str,
    argv: list[str],
    change: Callable[[h5py.File], None],
    expected: str,
) -> None:
    with h5py.File(project / PAIRS, "r+") as file:
        change(file)
    assert_refused(stage, argv, PAIRS.as_posix(), expected)


@pytest.mark.parametrize(("stage", "argv"), [("train", TRAIN), ("evaluate", EVALUATE)])
@pytest.mark.parametrize("spoil", [empty, cut])
def test_a_pair_file_that_was_cut(
    project: Path, stage: str, argv: list[str], spoil: Callable[[Path], None]
) -> None:
    spoil(project / PAIRS)
    assert_refused(stage, argv, PAIRS.as_posix())


def test_the_weights_of_another_method(project: Path) -> None:
    shutil.copy(project / weights(CB), project / weights(CF))
    expected = f"{weights(CF)} needs weights of {CF}, has {CB}"
    assert_refused("evaluate", EVALUATE, expected)


# As processes of their own.


def ended(stage: str, argv: list[str]) -> str:
    """What a stage that runs by itself says last; it has to end with code 1, without traceback."""
    command = [sys.executable, "-m", "stages", stage, *argv]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert "Traceback" not in done.stderr
    return done.stderr.splitlines()[-1]


def test_a_process_ends_with_one_sentence_and_code_1(project: Path) -> None:
    (project / PAIRS).unlink()
    shutil.rmtree(project / "results" / CF)
    said = ended("evaluate", EVALUATE)
    assert said.endswith(f"a pair file is needed at {PAIRS}, there is none: run preprocess")
    assert not (project / "results" / CF).exists()


def test_a_process_names_the_scan_that_is_spoilt(blank: Path) -> None:
    write_scans(blank / "scans", cut)
    use_local("kitti", "scans", BY_ITEM)
    said = ended("preprocess", PREPROCESS)
    assert "scans/sequences/00/velodyne/000000.bin needs 16 bytes per point" in said
    assert files_below(PAIRS.parent) == []


# Defects that were met in the wild.


@pytest.mark.real
def test_the_real_scan_that_is_truncated(real_data: Path, blank: Path) -> None:
    scan = real_data / "malformed" / "truncated_scan.bin"
    write_scans(blank / "scans", lambda path: path.write_bytes(scan.read_bytes()))
    use_local("kitti", "scans", BY_ITEM)
    assert_refused("preprocess", PREPROCESS, "000000.bin", "needs 16 bytes per point")


@pytest.mark.real
def test_the_real_mesh_without_a_header(real_data: Path, blank: Path) -> None:
    mesh = real_data / "malformed" / "off_without_header.off"
    (blank / "boxes" / "bed" / "train" / "bed_0001.off").write_bytes(mesh.read_bytes())
    run_instance(instance("acquire@modelnet40"))
    assert_refused("preprocess", PREPROCESS, "bed_0001.off needs to begin with OFF")


@pytest.mark.real
def test_the_real_mesh_with_a_fused_header_is_read(real_data: Path, blank: Path) -> None:
    mesh = real_data / "malformed" / "off_fused_header.off"
    (blank / "boxes" / "bed" / "train" / "bed_0001.off").write_bytes(mesh.read_bytes())
    run_instance(instance("acquire@modelnet40"))
    run_instance(instance(f"preprocess@{SCENARIO}"))
    assert len(read_off(mesh).vertices) > 100
    assert PAIRS.is_file()
