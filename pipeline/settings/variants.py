"""Variants of a learned method, each trained on its own: what Tables 3 to 5 compare."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from types import MappingProxyType

from pipeline.settings.params import Params

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


def variants(params: Params, name: str, value: str | None = None) -> list[tuple[str, Variant]]:
    """Every method and variant that one ablation compares, the method as it is among them.

    With ``value`` those alone that have it for what the ablation is named after.
    """
    found: list[tuple[str, Variant]] = []
    for method in _methods(params, name):
        network = getattr(params.methods, method).network
        axes = {
            key: [value]
            if value and key == name
            else dict.fromkeys([getattr(network, key), *getattr(params.ablation, listed)])
            for key, listed in TRAINED[name].items()
        }
        found += [
            (method, dict(zip(axes, values, strict=True))) for values in product(*axes.values())
        ]
    return found


def settings_trained(params: Params, method: str, variant: Variant) -> list[str]:
    """Under which settings the tables show a training: the method as it is stands in all three."""
    if not is_as_it_is(params, method, variant):
        return [setting_of(variant)]
    network = getattr(params.methods, method).network
    names = [name for name in TRAINED if method in _methods(params, name)]
    return [setting_of({key: getattr(network, key) for key in TRAINED[name]}) for name in names]


def _methods(params: Params, name: str) -> Sequence[str]:
    return FUSED if name == "fusion" else params.ablation.methods


def is_as_it_is(params: Params, method: str, variant: Variant) -> bool:
    """Whether a variant is the method as params.yaml has it."""
    network = getattr(params.methods, method).network
    return all(getattr(network, key) == value for key, value in variant.items())


def setting_of(variant: Variant) -> str:
    """What a variant is called in tables: ``representation=euler,scaling=raw``."""
    return ",".join(f"{key}={value}" for key, value in variant.items())


def folder_of(params: Params, ablation: str, method: str, variant: Variant) -> Path:
    """Where the files of a variant lie among all weights.

    For example ``ablations/representation/euler/pcrdiffusion_cf-raw``. The method as it is was
    trained once, among the representations, for all ablations.
    """
    if is_as_it_is(params, method, variant):
        network, ablation = getattr(params.methods, method).network, "representation"
        variant = {key: getattr(network, key) for key in TRAINED[ablation]}
    others = [value for key, value in variant.items() if key != ablation]
    return Path("ablations", ablation, variant[ablation], "-".join([method, *others]))
