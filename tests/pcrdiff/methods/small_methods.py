"""One small copy of every method, and clouds that each of them can read."""

from collections.abc import Callable
from typing import Any, TypedDict, TypeVar

import torch

from pcrdiff.bindings.open3d_registration import FeatureMatching
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.hypotheses import Refinement, VerifiedMethod
from pcrdiff.methods.constant import Constant
from pcrdiff.methods.dcp_v1 import DCPv1
from pcrdiff.methods.dcp_v2 import DCPv2
from pcrdiff.methods.deepgmr import DeepGMR
from pcrdiff.methods.egst import EGST
from pcrdiff.methods.fgr import FGR
from pcrdiff.methods.fmr import FMR
from pcrdiff.methods.gicp import GICP
from pcrdiff.methods.gicp_multistart import GICPMultistart
from pcrdiff.methods.icp import ICP
from pcrdiff.methods.icp_centroid import ICPCentroid
from pcrdiff.methods.identity import Identity
from pcrdiff.methods.kiss_matcher import KISSMatcher
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cb_moved import PCRDiffusionCBMoved
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.methods.pcrnet import PCRNet
from pcrdiff.methods.pointnetlk import PointNetLK
from pcrdiff.methods.ransac_fpfh import RansacFPFH
from pcrdiff.methods.ransac_multistart import RansacMultistart
from pcrdiff.methods.rpmnet import RPMNet
from pcrdiff.methods.sc2_pcr import SC2PCR
from pcrdiff.methods.small_gicp import SmallGICP
from pcrdiff.methods.trimmed_icp import TrimmedICP
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.models.pose_encoder import Diffusion, Fusion
from pcrdiff.models.pose_space import Scaling
from pcrdiff.models.refinement import RefinedMethod
from pcrdiff.registration import LearnedMethod, Method
from tests.pcrdiff.synthetic_clouds import random_poses, seeded, synthetic_pairs

WALK = Walk(timesteps=20, steps=3, sampler="ddpm")
OWN_WALK = Walk(timesteps=20, steps=3, sampler="feedback", spacing="quadratic", start="mode")


class Features(TypedDict):
    """How FPFH features are computed."""

    feature_radius: float
    feature_neighbours: int
    normal_radius: float


FPFH: Features = {"feature_radius": 0.3, "feature_neighbours": 128, "normal_radius": 0.2}


def awaken(method: LearnedMethod) -> None:
    """As if training had moved the pose encoder, which starts at zero."""
    for name, parameter in method.named_parameters():
        if name.startswith("pose_encoder"):
            torch.nn.init.normal_(parameter, std=0.1)


def make_cf(
    walk: Walk = WALK,
    representation: RepresentationName = "quaternion",
    scaling: Scaling = "raw",
    fusion: Fusion = "source",
    diffusion: Diffusion = "with",
) -> PCRDiffusionCF:
    torch.manual_seed(0)
    method = PCRDiffusionCF(walk, 32, representation, scaling, fusion, diffusion)
    awaken(method)
    return method


def make_cb(
    walk: Walk = WALK,
    representation: RepresentationName = "quaternion",
    scaling: Scaling = "raw",
    diffusion: Diffusion = "with",
) -> PCRDiffusionCB:
    torch.manual_seed(0)
    method = PCRDiffusionCB(walk, 16, 6, 0.5, 5, representation, scaling, diffusion)
    awaken(method)
    return method


def make_fgr() -> FGR:
    return FGR(iterations=64, max_distance=0.01, **FPFH)


Matched = TypeVar("Matched", bound=VerifiedMethod)


def make_matched(kind: Callable[..., Matched], starts: int) -> Matched:
    """A method that refines starts made of matched features."""
    refinement = Refinement((0.1,), 0.05, 0.1, coarse_points=64, finalists=3)
    return kind(FeatureMatching(max_distance=0.05, **FPFH), starts, refinement)


Refined = TypeVar("Refined", bound=RefinedMethod)


def make_matching(kind: Callable[..., Refined]) -> Refined:
    """RPMNet or EGST."""
    torch.manual_seed(0)
    return kind(
        feature_dim=16, neighbours=6, radius=0.5, train_updates=2, updates=3, normals="estimated"
    )


Moved = TypeVar("Moved", bound=DiffusedMethod[Any])


def make_moved(kind: Callable[..., Moved], walk: Walk = OWN_WALK, **given: int) -> Moved:
    """A method that moves what it knows of the source, as if it had been prepared."""
    torch.manual_seed(0)
    method = kind(walk, feature_dim=16, attention_layers=1, **given)
    method.prepare(synthetic_pairs(8, 40, generator=seeded(3)))
    return method


CLASSICAL: dict[str, Callable[[], Method]] = {
    "identity": Identity,
    "constant": lambda: Constant(random_poses(5, generator=seeded(0))),
    "icp_centroid": lambda: ICPCentroid(max_iterations=100, max_distance=0.5),
    "icp": lambda: ICP(max_iterations=30, max_distance=0.5),
    "trimmed_icp": lambda: TrimmedICP(max_iterations=100),
    "gicp": lambda: GICP(max_iterations=30, max_distance=0.5),
    "fgr": make_fgr,
    "ransac_fpfh": lambda: RansacFPFH(max_distance=0.025, **FPFH),
    "small_gicp": lambda: SmallGICP(max_iterations=20, max_distance=0.025, **FPFH),
    "gicp_multistart": lambda: GICPMultistart(
        random_poses(5, generator=seeded(0)),
        starts=64,
        refinement=Refinement((0.5, 0.1), 0.05, 0.1, coarse_points=64, finalists=3),
    ),
    "kiss_matcher": lambda: KISSMatcher(voxel_size=0.05, timeout=60.0),
    "ransac_multistart": lambda: make_matched(RansacMultistart, starts=64),
    "sc2_pcr": lambda: make_matched(SC2PCR, starts=8),
}
LEARNED: dict[str, Callable[[], LearnedMethod]] = {
    "pointnetlk": lambda: PointNetLK(feature_dim=64, difference=0.1, train_updates=2, updates=3),
    "pcrnet": lambda: PCRNet(feature_dim=32, train_updates=2, probes=16, updates=3),
    "deepgmr": lambda: DeepGMR(neighbours=6, feature_dim=32, components=6),
    "dcp_v1": lambda: DCPv1(feature_dim=16, neighbours=6),
    "dcp_v2": lambda: DCPv2(feature_dim=16, neighbours=6),
    "fmr": lambda: FMR(
        feature_dim=64, decoded_points=20, difference=0.1, train_updates=2, updates=3
    ),
    "rpmnet": lambda: make_matching(RPMNet),
    "egst": lambda: make_matching(EGST),
    "pcrdiffusion_cf": make_cf,
    "pcrdiffusion_cb": make_cb,
    "pcrdiffusion_cb_moved": lambda: make_moved(PCRDiffusionCBMoved, sinkhorn_iterations=5),
}
DIFFUSED = ("pcrdiffusion_cf", "pcrdiffusion_cb")
"""Those that draw while they register."""
FROM_THE_MODE = ("pcrdiffusion_cb_moved",)
"""Those that draw in training alone: their first walk begins in the mode of the noise."""


def make_method(name: str) -> Method:
    """By the name of its row; the same weights every time."""
    torch.manual_seed(0)
    return (CLASSICAL | LEARNED)[name]()
