"""From params to methods: the one place that knows all of their names.

Open3D is imported only where a method asks for it; it takes a second that training can spare.
"""

from collections.abc import Callable, Mapping

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
from pipeline.method_params import AnyLearned, Methods
from pipeline.params import DIFFUSED, Diffusion
from pipeline.sections import Section, SettingName
from pipeline.variants import AS_IT_IS, Variant

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
    if name == "constant":
        mean = Constant(train().T_target_source)
        return dict.fromkeys(methods.constant, mean)
    make = _classical(name)
    sections: Mapping[str, Section] = getattr(methods, name)
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
