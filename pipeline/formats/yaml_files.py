"""YAML files as DVC reads them, so that a stage is given the very values that DVC compares."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    Event,
    ScalarEvent,
)

DEEPEST = 100
MOST = 1_000_000
"""Levels and values of one file; what has more exhausts the stack or the memory of its reader."""


def read_yaml(path: Path) -> Any:  # noqa: ANN401  YAML is anything
    """Return what a file holds: YAML 1.2 in UTF-8, in which 012 is 12 and 1e-5 is a number.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not YAML, gives a key twice, or is too large.
    """
    try:
        text = path.read_text(encoding="utf-8")
        _check_size(YAML(typ="safe").parse(text))
        return YAML(typ="safe").load(text)
    except (YAMLError, ValueError, LookupError) as error:  # LookupError: of `!!int ""`
        said = " ".join(str(error).partition("To suppress this check")[0].split())
        raise ValueError(f"{path} is not YAML: {said}") from error


def read_mapping(path: Path) -> dict[str, Any]:
    """Return what a file holds that is a mapping.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not YAML, or no mapping.
    """
    values = read_yaml(path)
    if not isinstance(values, dict):
        raise ValueError(f"{path} needs to be a mapping, got {type(values).__name__}")
    return values


def flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested mappings as ``a.b.c`` -> value; lists and empty mappings stay whole."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        inside = isinstance(value, Mapping) and value
        found |= flat(value, f"{prefix}{name}.") if inside else {f"{prefix}{name}": value}
    return found


@dataclass(eq=False)
class _Size:
    """The size of a value with everything in it."""

    values: int = 1
    levels: int = 0

    def add(self, part: "_Size") -> None:
        self.values += part.values
        self.levels = max(self.levels, part.levels + 1)


def _check_size(events: Iterable[Event]) -> None:
    """Refuse what is too large once each alias is what it stands for, before that is built."""
    anchored: dict[str, _Size] = {}
    opened = [_Size()]
    for event in events:
        if isinstance(event, CollectionStartEvent):
            opened.append(_Size())
            anchored[event.anchor] = opened[-1]
        elif isinstance(event, CollectionEndEvent):
            part = opened.pop()
            opened[-1].add(part)
        elif isinstance(event, ScalarEvent):
            opened[-1].add(_Size())
        elif isinstance(event, AliasEvent):
            part = anchored.get(event.anchor, _Size())
            if part in opened:
                raise ValueError(f"*{event.anchor} stands inside what it stands for")
            opened[-1].add(part)
        if opened[-1].values > MOST or len(opened) + opened[-1].levels > DEEPEST:
            raise ValueError(f"it has more than {MOST} values or {DEEPEST} levels")
