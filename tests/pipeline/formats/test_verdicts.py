"""Verdicts come back as they were written, or are refused in one sentence with the file."""

import json
from pathlib import Path

import numpy as np
import pytest

from pcrdiff.registration import EVIDENCE
from pcrdiff.verdict import Verdict, fit_verdict
from pipeline.formats.verdicts import read_verdicts, write_verdicts

Changed = dict[str, object]


def fitted(pairs: int) -> Verdict:
    generator = np.random.default_rng(pairs)
    evidence = generator.random((pairs, len(EVIDENCE)))
    return fit_verdict(evidence, evidence[:, 0] > 0.2)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "verdicts" / "kitti.json"
    write_verdicts(path, {"official": fitted(400), "few": fitted(3)})
    return path


def test_verdicts_come_back_to_the_last_bit(file: Path) -> None:
    assert read_verdicts(file) == {"official": fitted(400), "few": fitted(3)}
    assert read_verdicts(file)["official"].threshold is not None
    assert read_verdicts(file)["few"].threshold is None


def test_the_same_verdicts_give_the_same_bytes(file: Path, tmp_path: Path) -> None:
    write_verdicts(tmp_path / "b.json", {"few": fitted(3), "official": fitted(400)})
    assert (tmp_path / "b.json").read_bytes() == file.read_bytes()


def test_refuses_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"verdicts are needed at \S+a\.json"):
        read_verdicts(tmp_path / "a.json")


@pytest.mark.parametrize("kept", [0.0, 0.5, 0.99])
def test_refuses_a_file_that_is_cut_short(file: Path, kept: float) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ValueError, match=r"kitti\.json needs verdicts, the file is none"):
        read_verdicts(file)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"mean": [0.0] * 5}, "needs verdicts on residual, overlap"),
        ({"mean": ["much"] * 6}, r"settings\.few\.mean\.0 is none"),
        ({"threshold": "high"}, r"settings\.few\.threshold is none"),
        ({"intercept": None}, r"settings\.few\.intercept is none"),
    ],
)
def test_refuses_what_is_no_verdict_and_says_where(file: Path, changed: Changed, said: str) -> None:
    content = json.loads(file.read_text())
    content["settings"]["few"] |= changed
    file.write_text(json.dumps(content))
    with pytest.raises(ValueError, match=said) as refused:
        read_verdicts(file)
    assert "\n" not in str(refused.value)


def test_refuses_verdicts_on_other_evidence(file: Path) -> None:
    file.write_text(file.read_text().replace('"sharpness"', '"colour"'))
    with pytest.raises(ValueError, match=r"kitti\.json needs verdicts on residual, .*, has others"):
        read_verdicts(file)
