"""Variants of a learned method, each trained by itself: what Tables 3 to 5 compare."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from types import MappingProxyType

from pipeline.params import Ablation

Variant = Mapping[str, str]
"""The keys of the method's ``network`` that differ, and their values."""
AS_IT_IS: Variant = MappingProxyType({})
"""The method as params.yaml has it."""
FUSED = ("pcrdiffusion_cf",)
"""The methods that Table 5 fuses in different ways."""


Axes = tuple[Sequence[str], Mapping[str, Sequence[str]]]
"""Methods, and the values of each key that is varied."""


def _diffusion(ablation: Ablation) -> Axes:
    return ablation.methods, {"diffusion": ablation.diffusions}


def _representation(ablation: Ablation) -> Axes:
    axes = {
        "representation": list[str](ablation.representations),
        "scaling": list[str](ablation.scalings),
    }
    return ablation.methods, axes


def _fusion(ablation: Ablation) -> Axes:
    return FUSED, {"fusion": ablation.fusions}


TRAINED: Mapping[str, Callable[[Ablation], Axes]] = {
    "diffusion": _diffusion,
    "representation": _representation,
    "fusion": _fusion,
}
"""By the name of the ablation: its methods, and the lists whose every combination is trained."""


def variants(ablation: Ablation, name: str) -> list[tuple[str, Variant]]:
    """Every method and variant of one ablation."""
    methods, axes = TRAINED[name](ablation)
    values = product(*axes.values())
    combined = [dict(zip(axes, chosen, strict=True)) for chosen in values]
    return [(method, variant) for method in methods for variant in combined]


def setting_of(variant: Variant) -> str:
    """What a variant is called in tables: ``representation=euler,scaling=raw``."""
    return ",".join(f"{key}={value}" for key, value in variant.items())


def parse_variant(setting: str) -> Variant:
    """Inverse of :func:`setting_of`; nothing for the method as it is.

    Raises:
        ValueError: It is not a list of ``key=value``.
    """
    pairs = [part.partition("=") for part in setting.split(",")] if setting else []
    if not all(key and value for key, _, value in pairs):
        raise ValueError(f"a variant needs key=value,key=value, got {setting!r}")
    return {key: value for key, _, value in pairs}


def weights_of(folder: Path, method: str, variant: Variant) -> Path:
    """Where the weights of a variant lie."""
    return folder / f"{'-'.join([method, *variant.values()])}.safetensors"
