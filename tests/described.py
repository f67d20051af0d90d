"""dvc.yaml with its templates filled in: what DVC would run, as data."""

import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.nodes import CollectionNode, Node, SequenceNode

from pipeline.formats.yaml_files import read_yaml

REPOSITORY = Path(__file__).resolve().parent.parent
VARIABLE = re.compile(r"\$\{([^}]+)\}")


@dataclass(frozen=True)
class Instance:
    """One stage that DVC would run."""

    template: str
    """Its name in dvc.yaml, without what comes after ``@``."""
    name: str
    item: Mapping[str, Any]
    """What a matrix varies, or what a foreach goes over; empty elsewhere."""
    content: Mapping[str, Any]
    """Its ``cmd``, ``params``, ``deps``, ``outs``, ``metrics`` and ``plots``."""

    @property
    def module(self) -> str:
        """The module that the command runs."""
        return self._run[0]

    @property
    def argv(self) -> list[str]:
        """The arguments of the command."""
        return self._run[1:]

    @property
    def _run(self) -> list[str]:
        """What follows ``sh stages/run``, whose first word names the module."""
        stage, *arguments = shlex.split(self.content["cmd"])[2:]
        return [f"stages.{stage}", *arguments]

    @property
    def deps(self) -> list[str]:
        """The paths it depends on."""
        return list(self.content["deps"])

    @property
    def outs(self) -> list[str]:
        """The paths it writes."""
        kinds = ("outs", "metrics", "plots")
        entries = [entry for kind in kinds for entry in self.content.get(kind, [])]
        return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in entries]


def read_templates() -> dict[str, Any]:
    """The stages of dvc.yaml as they are written."""
    templates: dict[str, Any] = read_yaml(REPOSITORY / "dvc.yaml")["stages"]
    return templates


def read_repository_params() -> dict[str, Any]:
    """The plain content of params.yaml."""
    params: dict[str, Any] = read_yaml(REPOSITORY / "params.yaml")
    return params


def write_yaml(path: Path, values: Mapping[str, Any]) -> None:
    """Write a file as DVC does."""
    YAML().dump(values, path)


def flow_style_lists(node: Node | None) -> list[Node]:
    """Lists written ``[a, b]``; empty ones are fine, and so are mappings in braces."""
    if not isinstance(node, CollectionNode):
        return []
    children = [
        child for pair in node.value for child in (pair if isinstance(pair, tuple) else [pair])
    ]
    own = [node] if isinstance(node, SequenceNode) and node.flow_style and node.value else []
    return own + [found for child in children for found in flow_style_lists(child)]


def expand(params: Mapping[str, Any]) -> list[Instance]:
    """Every stage of dvc.yaml under these params, in the order of the file."""
    return [
        Instance(template, name, item, _fill(body, context))
        for template, stage in read_templates().items()
        for name, item, body, context in _instances(template, stage, params)
    ]


def _instances(
    template: str, stage: Mapping[str, Any], params: Mapping[str, Any]
) -> Iterator[tuple[str, Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]]]:
    if "foreach" in stage:
        for key, item in _fill(stage["foreach"], params).items():
            yield f"{template}@{key}", item, stage["do"], {**params, "key": key, "item": item}
    elif "matrix" in stage:
        axes = {name: _fill(values, params) for name, values in stage["matrix"].items()}
        body = {name: value for name, value in stage.items() if name != "matrix"}
        for values in product(*axes.values()):
            item = dict(zip(axes, values, strict=True))
            yield f"{template}@{'-'.join(values)}", item, body, {**params, "item": item}
    else:
        yield template, {}, stage, params


def _fill(value: Any, context: Mapping[str, Any]) -> Any:  # noqa: ANN401  YAML is anything
    """Replace each ``${a.b}``; a string that is nothing else becomes what the name stands for."""
    if isinstance(value, dict):
        return {_fill(key, context): _fill(entry, context) for key, entry in value.items()}
    if isinstance(value, list):
        return [_fill(entry, context) for entry in value]
    if not isinstance(value, str):
        return value
    whole = VARIABLE.fullmatch(value)
    if whole:
        return _look_up(whole[1], context)
    return VARIABLE.sub(lambda found: str(_look_up(found[1], context)), value)


def _look_up(name: str, context: Mapping[str, Any]) -> Any:  # noqa: ANN401  YAML is anything
    found: Any = context
    for part in name.split("."):
        found = found[part]
    return found
