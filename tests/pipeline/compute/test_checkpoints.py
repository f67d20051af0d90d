"""Checkpoints: equal after a round trip, whole after a kill, one training at a time."""

import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
import torch

from pipeline.compute.checkpoints import (
    LATEST,
    PREVIOUS,
    DiskCheckpoint,
    checkpoints_folder,
    fingerprint,
    open_checkpoint,
)

REPOSITORY = Path(__file__).parents[3]
PARAMS = {"train": {"epochs": 3, "rate": 1e-3}, "seed": 7}


def state(epoch: int) -> tuple[dict[str, torch.Tensor], dict[str, object]]:
    generator = torch.Generator().manual_seed(epoch)
    weights = torch.randn(4, 3, generator=generator)
    tensors = {
        "weights": weights,
        "transposed": weights.T,
        "half": weights.half(),
        "steps": torch.tensor(epoch),
        "generator": generator.get_state(),
        "empty": torch.zeros(0, 3),
    }
    return tensors, {"epoch": epoch, "best": 0.1 + 0.2, "rows": [{"loss": 1e-17}]}


def assert_state(checkpoint: DiskCheckpoint, epoch: int) -> None:
    loaded = checkpoint.load()
    assert loaded is not None
    tensors, record = state(epoch)
    assert loaded[1] == record
    assert loaded[0].keys() == tensors.keys()
    for name, tensor in tensors.items():
        torch.testing.assert_close(loaded[0][name], tensor, rtol=0, atol=0)


@pytest.fixture(autouse=True)
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DVC_ROOT", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "model.py").write_text("pass\n")
    (tmp_path / "pairs.h5").write_bytes(b"pairs")
    return tmp_path


DEPS = [Path("pairs.h5"), Path("code")]


def interrupted_training(epochs: int) -> Path:
    """Save so many epochs, then fail; return the checkpoint's folder."""
    with suppress(KeyboardInterrupt), open_checkpoint(PARAMS, DEPS) as checkpoint:
        for epoch in range(1, epochs + 1):
            checkpoint.save(*state(epoch))
        raise KeyboardInterrupt
    return checkpoint.folder


def test_what_was_saved_is_loaded_bit_for_bit(data: Path) -> None:
    folder = interrupted_training(2)
    assert folder.parent == checkpoints_folder(data)
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        assert_state(checkpoint, 2)


def test_a_new_training_starts_with_nothing() -> None:
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        assert checkpoint.load() is None


def test_a_training_that_ends_well_leaves_nothing(data: Path) -> None:
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        checkpoint.save(*state(1))
    assert list(checkpoints_folder(data).iterdir()) == []


def test_the_same_state_is_the_same_bytes() -> None:
    first = (interrupted_training(3) / LATEST).read_bytes()
    assert (interrupted_training(3) / LATEST).read_bytes() == first


def test_tensors_that_share_memory_can_be_saved() -> None:
    tied = torch.ones(3)
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        checkpoint.save({"a": tied, "b": tied[:2]}, {})
        loaded = checkpoint.load()
    assert loaded is not None
    assert loaded[0]["b"].tolist() == [1, 1]


@pytest.mark.parametrize("keep", [0, 5, 100, -1])
def test_a_torn_file_falls_back_to_the_one_before(
    capsys: pytest.CaptureFixture[str], keep: int
) -> None:
    latest = interrupted_training(3) / LATEST
    latest.write_bytes(latest.read_bytes()[:keep])
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        assert_state(checkpoint, 2)
    assert "ignored the damaged checkpoint" in capsys.readouterr().err


def test_a_kill_between_the_two_renames_loses_one_epoch_only() -> None:
    folder = interrupted_training(3)
    (folder / LATEST).replace(folder / PREVIOUS)
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        assert_state(checkpoint, 3)


def test_two_torn_files_mean_a_fresh_start() -> None:
    folder = interrupted_training(3)
    for name in (LATEST, PREVIOUS):
        (folder / name).write_bytes(b"torn")
    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        assert checkpoint.load() is None


def test_a_full_disk_keeps_the_old_state_and_the_training(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    with open_checkpoint(PARAMS, DEPS) as checkpoint:
        checkpoint.save(*state(1))
        monkeypatch.setattr("pipeline.compute.checkpoints.save_file", full)
        checkpoint.save(*state(2))
        assert_state(checkpoint, 1)
    assert "training continues: [Errno 28]" in capsys.readouterr().err


def test_a_record_json_cannot_hold_is_refused() -> None:
    with (
        open_checkpoint(PARAMS, DEPS) as checkpoint,
        pytest.raises(ValueError, match="record must be JSON"),
    ):
        checkpoint.save({}, {"path": Path("x")})


def test_a_second_training_is_refused_with_the_first_ones_process() -> None:
    pid = re.escape(f"is running (process {os.getpid()})")
    with open_checkpoint(PARAMS, DEPS):
        with pytest.raises(ValueError, match=pid), open_checkpoint(PARAMS, DEPS):
            pass
        with open_checkpoint({"seed": 8}, DEPS):
            pass  # another training is free to run


def test_a_killed_training_frees_its_lock_and_leaves_its_state() -> None:
    code = (
        "import os, signal, torch\n"
        "from pathlib import Path\n"
        "from pipeline.compute.checkpoints import open_checkpoint\n"
        "with open_checkpoint({'a': 1}, [Path('pairs.h5')]) as checkpoint:\n"
        "    checkpoint.save({'w': torch.arange(3)}, {'epoch': 5})\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    killed = subprocess.run([sys.executable, "-c", code], env=environment)
    assert killed.returncode == -9
    with open_checkpoint({"a": 1}, [Path("pairs.h5")]) as checkpoint:
        loaded = checkpoint.load()
    assert loaded is not None
    assert (loaded[0]["w"].tolist(), loaded[1]) == ([0, 1, 2], {"epoch": 5})


def test_the_fingerprint_follows_params_and_bytes_and_nothing_else(
    data: Path,
) -> None:
    first = fingerprint(PARAMS, DEPS)
    assert fingerprint(dict(reversed(PARAMS.items())), DEPS[::-1]) == first
    assert fingerprint(PARAMS, [data / "code", data / "pairs.h5"]) == first
    assert fingerprint({**PARAMS, "seed": 8}, DEPS) != first
    (data / "code" / "__pycache__").mkdir()
    (data / "code" / "__pycache__" / "model.pyc").write_bytes(b"bytecode")
    assert fingerprint(PARAMS, DEPS) == first
    (data / "code" / "model.py").write_text("pass \n")
    changed = fingerprint(PARAMS, DEPS)
    assert changed != first
    (data / "pairs.h5").write_bytes(b"Pairs")
    assert fingerprint(PARAMS, DEPS) not in (first, changed)


def test_an_input_that_is_missing_is_named() -> None:
    with (
        pytest.raises(FileNotFoundError, match=r"depends on gone\.h5"),
        open_checkpoint(PARAMS, [Path("gone.h5")]),
    ):
        pass


def test_the_project_may_be_given(tmp_path: Path) -> None:
    with open_checkpoint(PARAMS, DEPS, root=tmp_path / "other") as checkpoint:
        assert checkpoint.folder.is_relative_to(tmp_path / "other")


def test_two_stages_that_are_told_the_same_have_checkpoints_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_STAGE", "train_fusion@pcrdiffusion_cf-source")
    with open_checkpoint({"fusion": "source"}, [], root=tmp_path):
        monkeypatch.setenv("DVC_STAGE", "train_diffusion@pcrdiffusion_cf-with")
        with open_checkpoint({"fusion": "source"}, [], root=tmp_path) as other:
            assert other.load() is None
        with (
            pytest.raises(ValueError, match="another training with the same params"),
            open_checkpoint({"fusion": "source"}, [], root=tmp_path),
            open_checkpoint({"fusion": "source"}, [], root=tmp_path),
        ):
            pass
