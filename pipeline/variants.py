"""Variants of a learned method, each trained on its own: what Tables 3 to 5 compare."""

from collections.abc import Mapping
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


TRAINED: Mapping[str, Mapping[str, str]] = {
    "diffusion": {"diffusion": "diffusions"},
    "representation": {"representation": "representations", "scaling": "scalings"},
    "fusion": {"fusion": "fusions"},
}
"""By the name of the ablation: the keys that it varies, and where ``ablation`` lists their values."""


def variants(ablation: Ablation, name: str, value: str | None = None) -> list[tuple[str, Variant]]:
    """Every method and variant of one ablation, or those alone that have ``value`` for its name."""
    methods = FUSED if name == "fusion" else ablation.methods
    axes = {
        key: [value] if value and key == name else getattr(ablation, listed)
        for key, listed in TRAINED[name].items()
    }
    combined = [dict(zip(axes, chosen, strict=True)) for chosen in product(*axes.values())]
    return [(method, variant) for method in methods for variant in combined]


def setting_of(variant: Variant) -> str:
    """What a variant is called in tables: ``representation=euler,scaling=raw``."""
    return ",".join(f"{key}={value}" for key, value in variant.items())


def folder_of(ablation: str, method: str, variant: Variant) -> Path:
    """Where the files of a variant lie among those of its ablation: ``euler/pcrdiffusion_cf-raw``."""
    others = [value for key, value in variant.items() if key != ablation]
    return Path(variant[ablation], "-".join([method, *others]))
