"""From params and weights to methods: the one place that knows all of their names.

Open3D is imported only where a method asks for it; it takes a second that training can spare.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.methods.constant import Constant
from pcrdiff.methods.dcp_v1 import DCPv1
from pcrdiff.methods.dcp_v2 import DCPv2
from pcrdiff.methods.deepgmr import DeepGMR
from pcrdiff.methods.egst import EGST
from pcrdiff.methods.fmr import FMR
from pcrdiff.methods.identity import Identity
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.methods.pcrnet import PCRNet
from pcrdiff.methods.pointnetlk import PointNetLK
from pcrdiff.methods.rpmnet import RPMNet
from pcrdiff.registration import LearnedMethod, Method, Pairs
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import read_weights
from pipeline.settings.methods import AnyLearned, Methods
from pipeline.settings.params import DIFFUSED, Diffusion, Params
from pipeline.settings.sections import Section, SettingName
from pipeline.settings.variants import AS_IT_IS, Variant

LEARNED: Mapping[str, Callable[..., LearnedMethod]] = {
    "pointnetlk": PointNetLK,
    "pcrnet": PCRNet,
    "deepgmr": DeepGMR,
    "dcp_v1": DCPv1,
    "dcp_v2": DCPv2,
    "fmr": FMR,
    "rpmnet": RPMNet,
    "egst": EGST,
    "pcrdiffusion_cf": PCRDiffusionCF,
    "pcrdiffusion_cb": PCRDiffusionCB,
}

Diffused = PCRDiffusionCF | PCRDiffusionCB
"""The methods that walk a pose back from noise."""


def settings_of(name: str, methods: Methods) -> list[SettingName]:
    """The settings in which the tables show a learned method; one training serves them all.

    Raises:
        ValueError: No such method.
    """
    return list(_section(name, methods).settings)


def build_learned(
    name: str,
    setting: SettingName,
    methods: Methods,
    diffusion: Diffusion,
    variant: Variant = AS_IT_IS,
) -> LearnedMethod:
    """A learned method with fresh weights, drawn from torch's own generator.

    Raises:
        ValueError: No such method, or the variant has a key that its network has not.
    """
    section = _section(name, methods)
    setting_told = section.settings[setting].model_dump()
    return _build(name, {**_network(name, section, variant), **setting_told}, diffusion)


def build_untrained(
    name: str, methods: Methods, diffusion: Diffusion, variant: Variant = AS_IT_IS
) -> LearnedMethod:
    """A learned method to be trained; it validates with as many updates as it trains with.

    Which settings evaluation has must not choose other weights.

    Raises:
        ValueError: No such method, or the variant has a key that its network has not.
    """
    told = _network(name, _section(name, methods), variant)
    if "train_updates" in told:
        told["updates"] = told["train_updates"]
    return _build(name, told, diffusion)


def _network(name: str, section: AnyLearned, variant: Variant) -> dict[str, object]:
    told = dict(section.network.model_dump())
    unknown = sorted(set(variant) - set(told))
    if unknown:
        raise ValueError(f"the network of {name} has no {', '.join(unknown)} to vary")
    return {**told, **variant}


def _build(name: str, told: dict[str, object], diffusion: Diffusion) -> LearnedMethod:
    if name in DIFFUSED:
        told["walk"] = Walk(**diffusion.model_dump())
    return LEARNED[name](**told)


def _section(name: str, methods: Methods) -> AnyLearned:
    if name not in LEARNED:
        raise ValueError(f"no learned method is called {name!r}")
    section: AnyLearned = getattr(methods, name)
    return section


def build_classical(
    name: str, methods: Methods, train: Callable[[], Pairs]
) -> Mapping[str, Method]:
    """A method that learns nothing, once per setting; ``constant`` alone asks for ``train``.

    Raises:
        ValueError: No such method.
    """
    sections: Mapping[str, Section] = getattr(methods, name, {})
    if name == "constant":
        mean = Constant(train().T_target_source)
        return dict.fromkeys(sections, mean)
    make = _classical(name)
    return {setting: make(**given.model_dump()) for setting, given in sections.items()}


def _classical(name: str) -> Callable[..., Method]:  # noqa: C901 - a case a method, no branches
    match name:
        case "identity":
            return Identity
        case "icp_centroid":
            from pcrdiff.methods.icp_centroid import ICPCentroid

            return ICPCentroid
        case "icp":
            from pcrdiff.methods.icp import ICP

            return ICP
        case "trimmed_icp":
            from pcrdiff.methods.trimmed_icp import TrimmedICP

            return TrimmedICP
        case "gicp":
            from pcrdiff.methods.gicp import GICP

            return GICP
        case "fgr":
            from pcrdiff.methods.fgr import FGR

            return FGR
        case "ransac_fpfh":
            from pcrdiff.methods.ransac_fpfh import RansacFPFH

            return RansacFPFH
        case "small_gicp":
            from pcrdiff.methods.small_gicp import SmallGICP

            return SmallGICP
        case "kiss_matcher":
            from pcrdiff.methods.kiss_matcher import KISSMatcher

            return KISSMatcher
    raise ValueError(f"no classical method is called {name!r}")


def load_settings(
    params: Params, name: str, pairs: Path, weights: Path | None
) -> Mapping[str, Method]:
    """A method, ready to register, in each of its settings; ``weights`` are a learned method's.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be.
    """
    if weights is None:
        return build_classical(name, params.methods, lambda: read_pairs(pairs, "train"))
    return {
        setting: load_learned(name, setting, params.methods, params.diffusion, weights)
        for setting in settings_of(name, params.methods)
    }


def load_learned(
    name: str,
    setting: SettingName,
    methods: Methods,
    diffusion: Diffusion,
    weights: Path,
    variant: Variant = AS_IT_IS,
) -> LearnedMethod:
    """A trained method, in one setting of the tables.

    Raises:
        FileNotFoundError, ValueError: The weights are not there, or are those of another network.
    """
    method = build_learned(name, setting, methods, diffusion, variant)
    try:
        method.load_state_dict(read_weights(weights, name))
    except RuntimeError as error:
        raise ValueError(f"{weights} does not fit {name} as params.yaml has it: {error}") from error
    return method.eval()


def load_diffused(name: str, methods: Methods, diffusion: Diffusion, weights: Path) -> Diffused:
    """A trained method that walks back from noise.

    Raises:
        FileNotFoundError, ValueError: The weights are not there, or are those of another network,
            or the method does not walk.
    """
    method = load_learned(name, "paper", methods, diffusion, weights)
    if not isinstance(method, Diffused):
        raise ValueError(f"{name} does not walk back from noise")
    return method
