"""Params that remember which of their keys were read."""

from collections.abc import ItemsView, Iterator, KeysView, ValuesView
from functools import partial
from inspect import isfunction
from typing import Any

from pipeline.settings.sections import Section

Reads = set[str]


def recorded(value: Any, path: str, reads: Reads, fixed: bool = False) -> Any:  # noqa: ANN401
    """Wrap a section, or note that the plain value at ``path`` was read."""
    if isinstance(value, Section):
        return RecordingSection(value, path, reads)
    if isinstance(value, dict):
        return RecordingDict(value, path, reads, fixed)
    reads.add(path)
    return value


class RecordingSection:
    """Stands for a section of params.yaml; ``path`` is its dotted key, empty for the file."""

    def __init__(
        self, section: Section, path: str, reads: Reads, replaced: frozenset[str] = frozenset()
    ) -> None:
        """``replaced`` are the fields that the program has set itself."""
        self._section, self._path, self._reads, self._replaced = section, path, reads, replaced

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  whatever the section has
        declared = getattr(type(self._section), name, None)
        if isinstance(declared, property) and declared.fget is not None:
            return declared.fget(self)
        if isfunction(declared):
            return partial(declared, self)
        value = getattr(self._section, name)
        return value if name in self._replaced else recorded(value, self._key(name), self._reads)

    def model_dump(self) -> "RecordingDict":
        """Its content; what is taken out of it is noted when it is taken."""
        content = self._section.model_dump()
        return RecordingDict(content, self._path, self._reads, True, self._replaced)

    def model_copy(self, *, update: dict[str, Any]) -> "RecordingSection":
        """A copy in which the updated fields are no longer those of the file."""
        copy = self._section.model_copy(update=update)
        return RecordingSection(copy, self._path, self._reads, self._replaced | set(update))

    def _key(self, name: str) -> str:
        return f"{self._path}.{name}" if self._path else name


class RecordingDict(dict[str, Any]):
    """Stands for a mapping; naming its keys reads it, unless they are the fields of a section."""

    def __init__(
        self,
        content: dict[str, Any],
        path: str,
        reads: Reads,
        fixed: bool,
        replaced: frozenset[str] = frozenset(),
    ) -> None:
        super().__init__(content)
        self._path, self._reads, self._fixed, self._replaced = path, reads, fixed, replaced

    def __getitem__(self, key: str) -> Any:  # noqa: ANN401  whatever it holds
        value = super().__getitem__(key)
        if key in self._replaced:
            return value
        return recorded(value, f"{self._path}.{key}", self._reads, self._fixed)

    def get(self, key: str, default: Any = None) -> Any:  # noqa: ANN401
        """As dict has it."""
        return self[key] if key in self else default  # noqa: SIM401  dict's own notes nothing

    def __or__(self, other: Any) -> "RecordingDict":  # type: ignore[override]  # noqa: ANN401
        """With the entries of ``other``, which the program has set itself."""
        content = {key: dict.__getitem__(self, key) for key in dict.keys(self)} | other
        return RecordingDict(
            content, self._path, self._reads, self._fixed, self._replaced | set(other)
        )

    def __iter__(self) -> Iterator[str]:
        if not self._fixed or not len(self):
            self._reads.add(self._path)
        return super().__iter__()

    def keys(self) -> KeysView[str]:  # type: ignore[override]
        """As dict has it."""
        return KeysView(self)

    def values(self) -> ValuesView[Any]:  # type: ignore[override]
        """As dict has it."""
        return ValuesView(self)

    def items(self) -> ItemsView[str, Any]:  # type: ignore[override]
        """As dict has it."""
        return ItemsView(self)
