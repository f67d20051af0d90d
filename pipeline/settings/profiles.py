"""Profiles: ``profiles/quick.yaml`` is a whole params.yaml, the others say what differs from another."""

from collections.abc import Mapping
from io import StringIO
from itertools import takewhile
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap

from pipeline.formats.yaml_files import flat, read_mapping
from pipeline.settings.params import Params, check_params

BASE = "quick"
EXTENDS = "extends"
"""The key under which a profile names the one that it differs from, if that is not ``BASE``."""
WITHOUT = "without"
"""The key under which it lists keys of that one, as ``a.b.c``, that are removed first."""

Values = dict[str, Any]


def profile_names(root: Path) -> list[str]:
    """Return the profiles there are."""
    return sorted(path.stem for path in (root / "profiles").glob("*.yaml"))


def profile_values(root: Path, name: str) -> Values:
    """Return the values of params.yaml under a profile.

    They are those of the profile that it extends without the keys that it lists under ``WITHOUT``,
    and with its own values: mappings are merged key by key, lists and other values replaced.

    Raises:
        FileNotFoundError: There is no such profile.
        ValueError: The profile is no mapping, extends itself, removes what is not there, or the
            values are not those of a params.yaml.
    """
    values = _merged(root, name)
    check_params(values, _path(root, name))
    return values


def read_profile(root: Path, name: str) -> Params:
    """Return the params of a profile; ``profile_values`` says how they come about.

    Raises:
        FileNotFoundError: There is no such profile.
        ValueError: As ``profile_values``.
    """
    return check_params(_merged(root, name), _path(root, name))


def write_profile(root: Path, name: str, *, force: bool) -> list[str]:
    """Write a profile into params.yaml, with the comments of ``BASE``.

    Args:
        root: The project.
        name: The profile.
        force: Overwrite values that are in no profile, too.

    Returns:
        ``key: old -> new`` for each value that changed.

    Raises:
        FileNotFoundError: There is no such profile.
        ValueError: The profile is not valid, or params.yaml holds values of its own, which would be
            lost.
    """
    wanted, params = profile_values(root, name), root / "params.yaml"
    present = read_mapping(params) if params.is_file() else {}
    known = (profile_values(root, each) for each in profile_names(root))
    if present and not force and present not in known:
        own = "params.yaml has values of its own, which are in no profile"
        raise ValueError(f"{own}; `pcrdiff profile {name} --force` overwrites them")
    new = params.with_suffix(".yaml.new")
    new.write_text(_text(root, name, wanted), encoding="utf-8")
    new.replace(params)
    return changed_values(present, wanted)


def changed_values(old: Values, new: Values) -> list[str]:
    """Return ``key: old -> new`` for each value in which the contents of two YAML files differ."""
    before, after = ({key: repr(value) for key, value in flat(each).items()} for each in (old, new))
    changed = [key for key in sorted({*before, *after}) if before.get(key) != after.get(key)]
    return [f"{key}: {before.get(key, 'absent')} -> {after.get(key, 'absent')}" for key in changed]


def _path(root: Path, name: str) -> Path:
    if name not in profile_names(root):
        known = ", ".join(profile_names(root)) or "none"
        raise FileNotFoundError(f"no profile {name!r} in {root / 'profiles'}; there are: {known}")
    return root / "profiles" / f"{name}.yaml"


def _merged(root: Path, name: str, extending: tuple[str, ...] = ()) -> Values:
    path = _path(root, name)
    overlay = read_mapping(path)
    if name == BASE:
        return overlay
    if name in extending:
        raise ValueError(f"{path}: {EXTENDS} needs another profile, it leads back to {name}")
    values = _merged(root, str(overlay.pop(EXTENDS, BASE)), (*extending, name))
    removed = overlay.pop(WITHOUT, [])
    if not isinstance(removed, list):
        raise ValueError(f"{path}: {WITHOUT} needs a list of keys, got {removed!r}")
    for key in map(str, removed):
        _remove(values, key, path)
    _merge(values, overlay)
    return values


def _remove(values: Values, key: str, path: Path) -> None:
    *outer, last = key.split(".")
    section: Any = values
    for part in outer:
        section = section.get(part) if isinstance(section, dict) else None
    if not isinstance(section, dict) or last not in section:
        raise ValueError(f"{path}: {WITHOUT} needs keys of the profile it extends, got {key!r}")
    del section[last]


def _merge(values: Values, overlay: Mapping[str, Any]) -> None:
    for key, value in overlay.items():
        if isinstance(value, dict) and isinstance(values.get(key), dict):
            _merge(values[key], value)
        else:
            values[key] = value


def _text(root: Path, name: str, wanted: Values) -> str:
    """Return the text of a profile: that of ``BASE`` with other values, under its own first lines."""
    base, own = (_path(root, each).read_text(encoding="utf-8") for each in (BASE, name))
    if name == BASE:
        return base
    yaml, written = YAML(), StringIO()
    document = yaml.load(base)
    _replace(document, wanted)
    yaml.dump(document, written)
    return _first_comment(own) + written.getvalue().removeprefix(_first_comment(base))


def _first_comment(text: str) -> str:
    lines = text.splitlines(keepends=True)
    return "".join(takewhile(lambda line: line.startswith("#"), lines))


def _replace(document: CommentedMap, wanted: Mapping[str, Any]) -> None:
    """Make the values of a document others; the comments of what stays are kept."""
    for key in document.keys() - wanted.keys():
        del document[key]
    for key, value in wanted.items():
        if isinstance(value, dict) and isinstance(document.get(key), dict):
            _replace(document[key], value)
        elif key not in document or document[key] != value:
            document[key] = value
            if value == [] and key in document.ca.items:
                _, _, beside, _ = document.ca.items[key]
                document.ca.items[key] = [None, None, beside, None]  # else the next list breaks
