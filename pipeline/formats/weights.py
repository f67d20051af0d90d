"""What a training leaves: weights (safetensors), its curve and its facts."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from pipeline.formats.files import write_atomically, write_csv

if TYPE_CHECKING:
    from pcrdiff.training.budget import Epoch


WEIGHTS, CURVE, FACTS = "weights.safetensors", "curve.csv", "facts.json"
"""The files of a training, in a folder of its own."""
SHIPPED = "shipped"
"""How tables, and folders of results, tell weights that came with the code."""
SHIPPED_FOLDER = Path("pcrdiff", "weights")
"""Where these lie, below the project."""


def write_weights(path: Path, weights: Mapping[str, Tensor], facts: Mapping[str, object]) -> None:
    """Write weights with one JSON record of what they are; two records would vary in order."""
    tensors = {name: value.contiguous() for name, value in weights.items()}
    write_atomically(path, save(tensors, {"facts": json.dumps(facts, sort_keys=True)}))


def read_facts(path: Path) -> dict[str, Any]:
    """Read the record of what weights are: which method's, its network, its training.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a safetensors file, or has no such record.
    """
    if not path.is_file():
        raise FileNotFoundError(f"weights are needed at {path}, there are none")
    try:
        with safe_open(path, framework="pt") as file:
            facts = json.loads((file.metadata() or {}).get("facts", "null"))
    except (SafetensorError, ValueError) as error:
        raise ValueError(f"{path} is not a safetensors file of ours: {error}") from error
    if not isinstance(facts, dict):
        raise ValueError(f"{path} needs a record of its training, has none")
    return facts


def shipped_weights(method: str, scenario: str) -> Path:
    """Where the network of a method for a scenario lies, below the project, if one is shipped."""
    return SHIPPED_FOLDER / method / f"{scenario}.safetensors"


def shipped_setting(setting: str) -> str:
    """What the tables call a setting of a method whose weights came with the code."""
    return f"{SHIPPED} {setting}".removesuffix(" paper")


def halved(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The same weights with matrices in float16, half as large; vectors and buffers as they are."""
    return {name: value.half() if value.dim() > 1 else value for name, value in weights.items()}


def read_weights(path: Path, method: str) -> dict[str, Tensor]:
    """Read the weights of ``method``, in float32 however they are stored.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not a safetensors file, or holds another method's weights.
    """
    if not path.is_file():
        raise FileNotFoundError(f"weights are needed at {path}, there are none: run train")
    try:
        with safe_open(path, framework="pt") as file:
            of = _method_of((file.metadata() or {}).get("facts", "{}"))
            if of != method:
                raise ValueError(f"{path} needs weights of {method}, has {of}")
            return {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118
    except SafetensorError as error:
        raise ValueError(f"{path} is not a safetensors file: {error}") from error


def _method_of(facts: str) -> object:
    """The method that a record names; None where it is no record or names none."""
    try:
        record = json.loads(facts)
    except ValueError:
        return None
    return record.get("method") if isinstance(record, dict) else None


def write_curve(path: Path, curve: "Sequence[Epoch]") -> None:
    """Write a training curve, one row an epoch; not validated: empty."""
    terms = sorted(curve[0].losses)  # by name: a resumed training has them in another order
    head = ["epoch", "step", "learning_rate", *terms, "val_error_r_deg", "val_error_t"]
    rows = []
    for e in curve:
        losses = [e.losses[term] for term in terms]
        rows.append([e.epoch, e.step, e.learning_rate, *losses, e.val_error_r_deg, e.val_error_t])
    write_csv(path, [head, *rows])
