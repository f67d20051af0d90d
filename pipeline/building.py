"""From params to methods: the one place that knows all of their names.

Open3D is imported only where a method asks for it; it takes a second that training can spare.
"""

from collections.abc import Mapping

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.methods.constant import Constant
from pcrdiff.methods.identity import Identity
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.registration import LearnedMethod, Method, Pairs
from pipeline.params import Diffusion, Methods


def build_learned(name: str, methods: Methods, diffusion: Diffusion) -> LearnedMethod:
    """A learned method with fresh weights, drawn from torch's own generator.

    Raises:
        ValueError: No such method.
    """
    walk = Walk(**diffusion.model_dump())
    match name:
        case "pcrdiffusion_cf":
            return PCRDiffusionCF(walk, **methods.pcrdiffusion_cf.model_dump())
        case "pcrdiffusion_cb":
            return PCRDiffusionCB(walk, **methods.pcrdiffusion_cb.model_dump())
    raise ValueError(f"no learned method is called {name!r}")


def build_classical(name: str, methods: Methods, train: Pairs) -> Mapping[str, Method]:
    """A method that learns nothing (but ``train``'s mean pose), once per setting of the tables.

    Raises:
        ValueError: No such method.
    """
    match name:
        case "identity":
            return {name: Identity() for name in methods.identity}
        case "constant":
            return {name: Constant(train.T_target_source) for name in methods.constant}
        case "icp_centroid":
            from pcrdiff.methods.icp_centroid import ICPCentroid

            settings = methods.icp_centroid.items()
            return {name: ICPCentroid(**setting.model_dump()) for name, setting in settings}
        case "icp":
            from pcrdiff.methods.icp import ICP

            return {name: ICP(**setting.model_dump()) for name, setting in methods.icp.items()}
        case "fgr":
            from pcrdiff.methods.fgr import FGR

            return {name: FGR(**setting.model_dump()) for name, setting in methods.fgr.items()}
    raise ValueError(f"no classical method is called {name!r}")
