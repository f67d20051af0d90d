"""A raw data set becomes the pairs of a scenario, with a record of how."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import torch

from pcrdiff.datasets.families import READERS
from pcrdiff.datasets.manifest import read_manifest, write_manifest
from pcrdiff.geometry.rigid import transform
from pcrdiff.registration import Pairs
from pipeline.settings.params import Scenario, read_params
from stages.preprocess import (
    LICENCES,
    SYNTHETIC_LICENCE,
    Preprocessed,
    find_doubled,
    preprocess,
)
from tests.pcrdiff.synthetic_clouds import joined
from tests.tiny import CATEGORIES, RAW, SCENARIO, instance, run_instance, tiny_params, write_params


def scenario(**changes: object) -> Scenario:
    told: dict[str, Any] = tiny_params()["scenarios"][SCENARIO]
    return Scenario.model_validate(told | changes)


def prepared(seed: int = 7, **changes: object) -> Preprocessed:
    return preprocess(SCENARIO, scenario(**changes), "modelnet40", RAW, seed=seed)


def made(seed: int = 7, **changes: object) -> dict[str, Pairs]:
    splits = prepared(seed, **changes).splits
    pairs = {name: joined(split.blocks) for name, split in splits.items()}
    assert {name: len(each) for name, each in pairs.items()} == {
        name: split.count for name, split in splits.items()
    }
    return pairs


@pytest.mark.usefixtures("project")
def test_splits_are_those_of_the_data_set_with_some_training_held_out() -> None:
    splits = made()
    sizes = {name: len(pairs) for name, pairs in splits.items()}
    assert sizes == {"train": 6, "val": 3, "test": 3}
    items = torch.cat([pairs.item for pairs in splits.values()])
    assert sorted(items.tolist()) == list(range(12))
    assert splits["test"].group == CATEGORIES
    assert prepared().label == "category"


@pytest.mark.usefixtures("project")
def test_the_pose_carries_the_source_onto_its_shuffled_copy() -> None:
    for pairs in made().values():
        moved = transform(pairs.T_target_source, pairs.source.double())
        distance = torch.cdist(moved, pairs.target.double()).amin(dim=-1).max().item()
        assert distance < 1e-5
        assert not torch.allclose(moved, pairs.target.double(), atol=1e-2)


@pytest.mark.usefixtures("project")
def test_no_two_splits_share_their_draws() -> None:
    splits = made().values()
    poses = torch.cat([pairs.T_target_source for pairs in splits])
    shifts = {tuple(pose[:3, 3].tolist()) for pose in poses}
    assert len(shifts) == len(poses)


@pytest.mark.usefixtures("project")
def test_the_seed_alone_decides_the_draws() -> None:
    first, again, other = (made(seed)["train"] for seed in (7, 7, 8))
    assert torch.equal(first.target, again.target)
    assert not torch.equal(first.T_target_source, other.T_target_source)


@pytest.mark.usefixtures("project")
def test_the_numbers_of_the_scenario_reach_the_pairs() -> None:
    pairs = made(num_points=20, max_rotation_deg=0.0, max_translation=0.5)["train"]
    assert pairs.source.shape == (6, 20, 3)
    assert torch.equal(pairs.T_target_source[:, :3, :3], torch.eye(3).double().repeat(6, 1, 1))
    assert 0 < pairs.T_target_source[:, :3, 3].max() <= 0.5
    cropped = made(num_points=20, keep=0.5)["train"]
    assert cropped.source.shape == (6, 10, 3)


@pytest.mark.usefixtures("project")
def test_the_angles_of_the_scenario_are_degrees() -> None:
    poses = made(max_rotation_deg=2.0)["train"].T_target_source
    cosines = (torch.einsum("bii->b", poses[:, :3, :3]) - 1) / 2
    angles = np.rad2deg(np.arccos(cosines.clamp(-1, 1).numpy()))
    assert 0.5 < angles.max() < 2.0 * 3**0.5 + 1e-6


@pytest.mark.usefixtures("project")
def test_normals_are_those_of_the_boxes_where_the_scenario_gives_them_and_change_no_point() -> None:
    plain, given = made(), made(normals="given")
    for split, pairs in given.items():
        assert plain[split].source_normals is plain[split].target_normals is None
        assert pairs.source_normals is not None
        assert pairs.target_normals is not None
        torch.testing.assert_close(pairs.source, plain[split].source)
        torch.testing.assert_close(pairs.target, plain[split].target)
        assert pairs.source_normals.abs().amax(dim=-1).min() > 1 - 1e-6  # boxes lie along the axes
        turned_back = pairs.target_normals.double() @ pairs.T_target_source[:, :3, :3]
        assert turned_back.abs().amax(dim=-1).min() > 1 - 1e-6


@pytest.mark.usefixtures("project")
def test_counts_repeat_or_leave_out_items() -> None:
    splits = made(pairs={"train": 13, "val": 2, "test": None})
    assert [len(splits[name]) for name in ("train", "val", "test")] == [13, 2, 3]
    assert len(set(splits["train"].item.tolist())) == 6


@pytest.mark.usefixtures("project")
def test_the_record_tells_where_the_pairs_come_from() -> None:
    preprocessed = prepared()
    record: Any = preprocessed.attributes["provenance"]
    assert (record["dataset"], record["source"]) == ("modelnet40", "local")
    assert len(record["files_sha256"]) == 64
    assert record["items"] == {"train": 6, "val": 3, "test": 3}
    assert record["licence"] == LICENCES["modelnet40"]
    assert record["scenario"] == scenario().model_dump(exclude={"degenerate"})
    assert "dropped_as_degenerate" not in record
    assert (preprocessed.attributes["scenario"], preprocessed.attributes["seed"]) == (SCENARIO, 7)


def preprocess_kitti(blank: Path, **changes: object) -> Preprocessed:
    """Acquire three synthetic scans, and make pairs of them."""
    params = tiny_params()
    params["acquire"]["kitti"]["synthetic"]["scans_per_sequence"] = 3
    write_params(params)
    run_instance(instance("acquire@kitti"))
    split = {"by": "item", "val_fraction": 0.34, "test_fraction": 0.34, "categories": "all"}
    kitti = scenario(split=split | {"val_groups": [], "test_groups": []}, **changes)
    return preprocess("kitti", kitti, "kitti", blank / "data/raw/kitti", seed=7)


def test_what_the_project_made_itself_has_its_own_licence(blank: Path) -> None:
    synthetic = preprocess_kitti(blank)
    record: Any = synthetic.attributes["provenance"]
    assert (record["source"], record["licence"]) == ("synthetic", SYNTHETIC_LICENCE)
    assert (synthetic.label, joined(synthetic.splits["train"].blocks).group) == ("scene", ("00",))


def test_given_normals_of_a_data_set_that_has_none_are_refused_by_its_name(blank: Path) -> None:
    blocks = preprocess_kitti(blank, dataset="kitti", normals="given").splits["train"].blocks
    with pytest.raises(
        ValueError, match=r"kitti: no pair of 00/\d+: .* normals, this one has none"
    ):
        joined(blocks)


def flatten(*names: str) -> None:
    """Make shapes of the data set lie on one line, whose faces have hardly an area."""
    for name in names:
        (path,) = Path("boxes").rglob(f"{name}.off")
        points = "\n".join(f"{k / 10} {k / 5} {3 * k / 10}" for k in (1, 2, 3, 4))
        path.write_text(f"OFF\n4 2 0\n{points}\n3 0 1 2\n3 1 2 3\n")
    run_instance(instance("acquire@modelnet40"))


@pytest.mark.usefixtures("project")
def test_a_degenerate_shape_is_refused_by_name_and_count_and_with_the_way_out() -> None:
    flatten("bed_0002", "chair_0002")
    with pytest.raises(
        ValueError,
        match=r"^modelnet40: no pair of bed_0002: .*, which is one of 2 degenerate pairs of its "
        r"split; `degenerate: drop` of the scenario leaves them out$",
    ):
        made()


@pytest.mark.usefixtures("project")
def test_degenerate_shapes_are_dropped_where_the_scenario_says_so_and_told() -> None:
    before = made(degenerate="drop")["train"]
    assert torch.equal(before.source, made()["train"].source)
    shapes = prepared(pairs={"train": 8, "val": None, "test": None}, degenerate="drop")
    assert shapes.dropped == {}
    flatten("bed_0002", "chair_0002", "sofa_0004")
    after = made(degenerate="drop")
    assert {split: len(pairs) for split, pairs in after.items()} == {
        "train": 4,
        "val": 3,
        "test": 2,
    }
    kept = [k for k in range(6) if before.item[k] in after["train"].item]
    assert torch.equal(after["train"].target, before.target[kept])
    told = prepared(degenerate="drop")
    record: Any = told.attributes["provenance"]
    assert told.dropped == {"train": ["bed_0002", "chair_0002"], "test": ["sofa_0004"]}
    assert record["dropped_as_degenerate"] == told.dropped


@pytest.mark.usefixtures("project")
def test_a_split_of_degenerate_shapes_alone_is_refused() -> None:
    flatten(*(f"{category}_0004" for category in CATEGORIES))
    with pytest.raises(ValueError, match=r"^modelnet40 test needs a shape .* degenerate, got 3 on"):
        made(degenerate="drop")


def test_every_family_of_params_has_a_reader_and_a_licence(repository: Path) -> None:
    families = {a.family for a in read_params(repository / "params.yaml").acquire.values()}
    assert families == READERS.keys() == LICENCES.keys()


def test_a_file_that_has_changed_since_is_refused(project: Path) -> None:
    (project / "boxes" / "bed" / "train" / "bed_0001.off").write_text("OFF\n")
    with pytest.raises(ValueError, match=r"bed_0001\.off with \d+ bytes, it has 4"):
        made()


def test_a_file_that_is_gone_since_is_refused(project: Path) -> None:
    (project / "boxes" / "bed" / "train" / "bed_0001.off").unlink()
    with pytest.raises(FileNotFoundError, match=r"bed_0001\.off, which is gone"):
        made()


def doubled_below(root: Path, family: str, chosen: dict[str, list[int]]) -> list[dict[str, str]]:
    """Names of the items whose content stands in several splits, of a folder just acquired."""
    write_manifest(root, root, source="local")
    digests = read_manifest(root, base=root).digests
    found = find_doubled(READERS[family](root), chosen, digests)
    return [{split: item.name for split, item in by_split.items()} for by_split in found]


def test_files_of_the_same_content_in_two_splits_are_found(tmp_path: Path) -> None:
    folder = tmp_path / "sequences" / "00" / "velodyne"
    folder.mkdir(parents=True)
    for number, content in enumerate("abacca"):
        (folder / f"{number:06d}.bin").write_text(content)
    found = doubled_below(tmp_path, "kitti", {"train": [0, 1], "val": [3, 4], "test": [2, 5]})
    assert found == [{"train": "00/000000", "test": "00/000002"}]
    assert doubled_below(tmp_path, "kitti", {"train": [0, 2, 5], "val": [1], "test": [3, 4]}) == []


def test_a_link_to_a_file_or_a_folder_has_the_content_of_what_it_leads_to(tmp_path: Path) -> None:
    scene = tmp_path / "kitchen"
    scene.mkdir()
    (scene / "cloud_bin_0.ply").write_text("a")
    (scene / "cloud_bin_1.ply").symlink_to("cloud_bin_0.ply")
    (tmp_path / "study").symlink_to("kitchen")
    chosen = {"train": [0], "val": [1], "test": [2]}
    name = "cloud_bin_0"
    assert doubled_below(tmp_path, "3dmatch", chosen) == [
        {"train": f"kitchen/{name}", "val": "kitchen/cloud_bin_1", "test": f"study/{name}"}
    ]


def test_shapes_of_the_same_content_in_two_hdf5_files_are_found(tmp_path: Path) -> None:
    clouds = np.random.default_rng(0).random((3, 5, 3), dtype=np.float32)
    (tmp_path / "shape_names.txt").write_text("bed\n")
    for split, data in (("train", clouds[:2]), ("test", clouds[1:])):
        (tmp_path / f"{split}_files.txt").write_text(f"ply_data_{split}0.h5\n")
        with h5py.File(tmp_path / f"ply_data_{split}0.h5", "w") as file:
            file["data"], file["label"] = data, np.zeros((2, 1), np.uint8)
    assert doubled_below(tmp_path, "modelnet40", {"train": [0, 1], "test": [2, 3]}) == [
        {"train": "ply_data_train0/0001", "test": "ply_data_test0/0000"}
    ]
    assert doubled_below(tmp_path, "modelnet40", {"train": [0, 1], "test": [3]}) == []


@pytest.mark.usefixtures("blank")
def test_content_in_two_splits_is_said_with_both_files(capsys: pytest.CaptureFixture[str]) -> None:
    run_instance(instance("acquire@modelnet40"))
    prepared()
    assert "same content" not in capsys.readouterr().err
    bed, other = (Path(f"boxes/bed/{name}.off") for name in ("train/bed_0001", "test/bed_0004"))
    other.write_bytes(bed.read_bytes())
    run_instance(instance("acquire@modelnet40"))
    prepared()
    said = capsys.readouterr().err
    assert said.count("modelnet40 has the same content in several splits, 1 times") == 1
    assert f"{bed} in " in said
    assert f"{other} in test" in said
