"""Profiles: whole params.yaml files to choose from, in ``profiles/``."""

from pathlib import Path

from pipeline.yaml_files import read_yaml


def profile_names(root: Path) -> list[str]:
    """Return the profiles there are."""
    return sorted(path.stem for path in (root / "profiles").glob("*.yaml"))


def write_profile(root: Path, name: str, *, force: bool) -> list[str]:
    """Make params.yaml a copy of a profile, comments included.

    Args:
        root: The project.
        name: The profile.
        force: Overwrite values that are in no profile, too.

    Returns:
        ``key: old -> new`` for each value that changed.

    Raises:
        FileNotFoundError: There is no such profile.
        ValueError: params.yaml holds values of its own, which would be lost.
    """
    wanted, params = root / "profiles" / f"{name}.yaml", root / "params.yaml"
    if name not in profile_names(root):
        known = ", ".join(profile_names(root)) or "none"
        raise FileNotFoundError(f"no profile {name!r} in {root / 'profiles'}; there are: {known}")
    changed = changed_values(params, wanted)
    if params.is_file() and not force and not _is_a_profile(root, params):
        own = "params.yaml has values of its own, which are in no profile"
        raise ValueError(f"{own}; `pcrdiff profile {name} --force` overwrites them")
    new = params.with_suffix(".yaml.new")
    new.write_bytes(wanted.read_bytes())
    new.replace(params)
    return changed


def changed_values(old: Path, new: Path) -> list[str]:
    """Return ``key: old -> new`` for each value in which two YAML files differ."""
    before, after = _flat(_read(old)), _flat(_read(new))
    changed = [key for key in sorted({*before, *after}) if before.get(key) != after.get(key)]
    return [f"{key}: {before.get(key, 'absent')} -> {after.get(key, 'absent')}" for key in changed]


def _is_a_profile(root: Path, params: Path) -> bool:
    paths = [root / "profiles" / f"{name}.yaml" for name in profile_names(root)]
    return any(_read(path) == _read(params) for path in paths)


def _read(path: Path) -> object:
    """Return the values of a YAML file; none if there is no file."""
    return read_yaml(path) if path.is_file() else {}


def _flat(values: object, prefix: str = "") -> dict[str, str]:
    """Return nested mappings as ``a.b.c`` -> text; lists stay whole."""
    if not isinstance(values, dict):
        return {prefix.removesuffix("."): repr(values)}
    parts = (_flat(value, f"{prefix}{key}.") for key, value in values.items())
    return {key: value for part in parts for key, value in part.items()}
