"""YAML is read as DVC reads it; what cannot be read is one sentence that names the file."""

from pathlib import Path

import pytest
from dvc.utils.hydra import apply_overrides
from dvc.utils.serialize import load_yaml

from pipeline.formats.yaml_files import flat, read_mapping, read_yaml
from pipeline.settings.params import read_params
from pipeline.settings.profiles import changed_values
from pipeline.tracking.restored import read_lock
from tests.described import REPOSITORY, read_repository_params, write_yaml
from tests.tiny import CF

VALUES = {
    "012": 12,
    "010": 10,
    "08": 8,
    "0o17": 15,
    "0x1F": 31,
    "1_000": 1000,
    "1e-5": 1e-5,
    "1e-05": 1e-5,
    "1e5": 1e5,
    "1:30": "1:30",
    "12:30:45": "12:30:45",
    "yes": "yes",
    "no": "no",
    "on": "on",
    "Off": "Off",
    "true": True,
    "~": None,
    "": None,
    "'08'": "08",
    "123e4567": float("inf"),
    "{<<: {b: 1, c: 2}, b: 3}": {"b": 3, "c": 2},
}
"""What is written, and what DVC reads."""


def written(folder: Path, text: str) -> Path:
    """A file of that text."""
    path = folder / "params.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", VALUES)
def test_reads_a_value_as_dvc_does(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, f"a: {text}\n")
    assert read_yaml(path) == load_yaml(path) == {"a": VALUES[text]}


@pytest.mark.parametrize("name", ["quick", "tables", "real", "paper"])
def test_reads_a_profile_as_dvc_does(name: str) -> None:
    path = REPOSITORY / "profiles" / f"{name}.yaml"
    assert read_yaml(path) == load_yaml(path)


def test_anchors_and_merged_keys_are_read(tmp_path: Path) -> None:
    path = written(tmp_path, "a: &x {b: 1}\nc: {<<: *x, d: 2}\ne: *x\n")
    assert read_yaml(path) == {"a": {"b": 1}, "c": {"b": 1, "d": 2}, "e": {"b": 1}}


@pytest.mark.parametrize("text", ["1e-5", "1e-05", "1E-5", "0.00001", "1.0e-5"])
def test_params_that_dvc_has_set_are_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "params.yaml"
    write_yaml(path, read_repository_params())
    apply_overrides(path, [f"train.pcrdiffusion_cf.learning_rate={text}"])
    assert getattr(read_params(path).train, CF).learning_rate == 1e-5


def test_a_seed_is_the_one_that_dvc_compares(tmp_path: Path) -> None:
    path = written(
        tmp_path, (REPOSITORY / "params.yaml").read_text().replace("seed: 7", "seed: 010")
    )
    assert read_params(path).seed == load_yaml(path)["seed"] == 10


def test_a_profile_differs_where_dvc_sees_it_differ(tmp_path: Path) -> None:
    new = read_yaml(written(tmp_path, "a: 012\nb: 0.00001\nc: 'yes'\n"))
    old = read_yaml(written(tmp_path, "a: 10\nb: 1e-5\nc: yes\n"))
    assert changed_values(old, new) == ["a: 10 -> 12"]


def test_nested_mappings_are_flattened_and_lists_and_empty_ones_stay_whole() -> None:
    values = {"a": {"b": {"c": 1}, "d": [2, {"e": 3}]}, "f": {}, "g": None}
    assert flat(values) == {"a.b.c": 1, "a.d": [2, {"e": 3}], "f": {}, "g": None}


def test_a_mapping_is_read_and_what_is_none_is_refused_by_its_file(tmp_path: Path) -> None:
    assert read_mapping(written(tmp_path, "a: {b: 1}\n")) == {"a": {"b": 1}}
    with pytest.raises(ValueError, match=r"params\.yaml needs to be a mapping, got list$"):
        read_mapping(written(tmp_path, "- 1\n"))


def test_numbers_of_a_lock_are_numbers(tmp_path: Path) -> None:
    (tmp_path / "dvc.lock").write_text("stages:\n  a:\n    params: {params.yaml: {b: 1e-05}}\n")
    assert read_lock(tmp_path)["a"]["params"]["params.yaml"]["b"] == 1e-5


WRONG = {
    "a key twice": ("a: 1\na: 2\n", 'found duplicate key "a"'),
    "a tab": ("\ta: 1\n", "while scanning"),
    "an open quote": ("a: 'x\n", "while scanning a quoted scalar"),
    "two documents": ("a: 1\n---\nb: 2\n", "expected a single document"),
    "an object": ("a: !!python/object:os.system {}\n", "could not determine a constructor"),
    "an empty number": ('a: !!int ""\n', "string index"),
    "an unknown alias": ("a: *b\n", "found undefined alias"),
    "a number of 5000 digits": (f"a: {'9' * 5000}\n", "4300 digits"),
    "a day that is none": ("a: 2026-13-45\n", "month"),
    "101 levels": ("a: " + "[" * 100 + "]" * 100, "more than 1000000 values or 100 levels"),
    "a million levels": ("a: " + "[" * 10**6 + "]" * 10**6, "values or 100 levels"),
    "itself": ("a: &x {b: [*x]}\n", "*x stands inside what it stands for"),
    "laughs": (
        "a0: &a0 [1, 1]\n" + "".join(f"a{n + 1}: &a{n + 1} [*a{n}, *a{n}]\n" for n in range(40)),
        "more than 1000000 values or",
    ),
    "merged laughs": (
        "a0: &a0 {b: 1}\n"
        + "".join(f"a{n + 1}: &a{n + 1} {{<<: [*a{n}, *a{n}]}}\n" for n in range(40)),
        "more than 1000000 values or",
    ),
}
"""What is written, and what has to be said of it."""


@pytest.mark.parametrize("name", WRONG)
def test_refuses(tmp_path: Path, name: str) -> None:
    text, expected = WRONG[name]
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=r"params\.yaml is not YAML: ") as refused:
        read_yaml(path)
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 600


def test_refuses_another_encoding(tmp_path: Path) -> None:
    path = tmp_path / "params.yaml"
    path.write_bytes("a: é\n".encode("latin1"))
    with pytest.raises(ValueError, match=r"params\.yaml is not YAML: 'utf-8' codec"):
        read_yaml(path)
