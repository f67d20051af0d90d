"""``pcrdiff register``: what it prints, what it writes, and its exit codes."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from pipeline.command import cli
from tests.pcrdiff.test_any_clouds import crops


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    source, target, _ = crops()
    names = tmp_path / "source.npy", tmp_path / "target.xyz"
    np.save(names[0], source)
    np.savetxt(names[1], target)
    return str(names[0]), str(names[1])


def register(*words: str) -> Result:
    return CliRunner().invoke(cli.app, ["register", *words])


def test_a_trusted_pose_is_printed_under_its_verdict_and_written(
    files: tuple[str, str], tmp_path: Path
) -> None:
    result = register(*files, "-o", str(tmp_path / "pose.txt"))
    assert result.exit_code == 0, result.output
    verdict, *rows = result.output.splitlines()
    assert verdict.startswith("trust: right with probability ")
    printed = np.array([row.split() for row in rows], float)
    np.testing.assert_array_equal(printed, np.loadtxt(tmp_path / "pose.txt"))


def test_json_is_one_object_with_the_fields_of_the_record(files: tuple[str, str]) -> None:
    result = register(*files, "--json", "--method", "features")
    given = json.loads(result.output)
    fields = ["T_target_source", "verdict", "probability", "overlap", "rmse", "method", "seconds"]
    assert list(given) == fields
    assert np.array(given["T_target_source"]).shape == (4, 4)


def test_a_doubted_pose_has_an_exit_code_of_its_own(files: tuple[str, str], tmp_path: Path) -> None:
    sphere = np.random.default_rng(0).normal(size=(800, 3))
    np.save(tmp_path / "sphere.npy", sphere / np.linalg.norm(sphere, axis=1, keepdims=True))
    result = register(files[0], str(tmp_path / "sphere.npy"))
    assert result.exit_code == 3, result.output
    assert result.output.startswith("doubt: ")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.ply"], "none.ply, there is no such file"),
        (["--method", "icp"], "a method among auto, features, random, diffusion, got 'icp'"),
    ],
)
def test_what_is_wrong_is_one_sentence_and_nothing_is_written(
    files: tuple[str, str], tmp_path: Path, words: list[str], message: str
) -> None:
    given = [files[0], *words] if words[0].endswith("ply") else [*files, *words]
    result = register(*given, "-o", str(tmp_path / "pose.txt"))
    assert result.exit_code == 1
    assert message in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "pose.txt").exists()
