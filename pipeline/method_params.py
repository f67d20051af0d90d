"""The settings of the methods, as ``methods`` in params.yaml holds them.

A method that learns nothing has only settings, one for each name that the tables show. A learned
one also has a network, which all its settings share. Lengths are in the clouds' unit.
"""

from typing import Annotated, Generic, TypeVar

from pydantic import Field

from pipeline.sections import (
    Count,
    Fusion,
    MultipleOfFour,
    Normals,
    Positive,
    Representation,
    Scaling,
    Section,
    SettingName,
    WithOrWithout,
)


class NoSetting(Section):
    """Of a method that has nothing to set."""


class ICPSetting(Section):
    """One setting of ICP, or of generalized ICP."""

    max_iterations: Count
    max_distance: Positive


class TrimmedICPSetting(Section):
    """One setting of trimmed ICP."""

    max_iterations: Count


class FeatureSetting(Section):
    """One setting of RANSAC on FPFH, and of what else matches such features."""

    max_distance: Positive
    feature_radius: Positive
    feature_neighbours: Count
    normal_radius: Positive


class FGRSetting(FeatureSetting):
    """One setting of FGR."""

    iterations: Count


class SmallGICPSetting(FeatureSetting):
    """One setting of small_gicp."""

    max_iterations: Count


class KISSMatcherSetting(Section):
    """One setting of KISS-Matcher; ``timeout`` of a pair in seconds."""

    voxel_size: Positive
    timeout: Positive


class Updates(Section):
    """One setting of a method that updates its pose again and again."""

    updates: Count


class LucasKanade(Section):
    """PointNetLK; ``difference`` is the step of its Jacobian's finite differences."""

    feature_dim: Count
    difference: Positive
    train_updates: Count


class DecodedLucasKanade(LucasKanade):
    """FMR."""

    decoded_points: Count


class RepeatedRegression(Section):
    """PCRNet; ``probes`` are the points that its loss asks for their neighbour."""

    feature_dim: Count
    train_updates: Count
    probes: Count


class Mixture(Section):
    """DeepGMR."""

    neighbours: Count
    feature_dim: Count
    components: Count


class Graph(Section):
    """DCP; the features' size is a multiple of the transformer's four heads."""

    feature_dim: MultipleOfFour
    neighbours: Count


class RepeatedMatching(Section):
    """RPMNet and EGST."""

    feature_dim: MultipleOfFour
    neighbours: Count
    radius: Positive
    train_updates: Count
    normals: Normals


class Diffused(Section):
    """What PCRDiffusion diffuses, and whether it does: Tables 3 and 4 vary it."""

    representation: Representation
    scaling: Scaling
    diffusion: WithOrWithout


class CorrespondenceFree(Diffused):
    """PCRDiffusion CF."""

    feature_dim: Count
    fusion: Fusion


class CorrespondenceBased(Diffused):
    """PCRDiffusion CB."""

    feature_dim: MultipleOfFour
    neighbours: Count
    radius: Positive
    sinkhorn_iterations: Count


Network = TypeVar("Network", bound=Section)
Setting = TypeVar("Setting", bound=Section)


class Learned(Section, Generic[Network, Setting]):
    """A learned method: what is trained, and in which settings the trained network answers."""

    network: Network
    settings: Annotated[dict[SettingName, Setting], Field(min_length=1)]


AnyLearned = Learned[Section, Section]


class Methods(Section):
    """One section a method, by its name in the tables."""

    identity: dict[SettingName, NoSetting]
    constant: dict[SettingName, NoSetting]
    icp_centroid: dict[SettingName, ICPSetting]
    icp: dict[SettingName, ICPSetting]
    trimmed_icp: dict[SettingName, TrimmedICPSetting]
    gicp: dict[SettingName, ICPSetting]
    fgr: dict[SettingName, FGRSetting]
    ransac_fpfh: dict[SettingName, FeatureSetting]
    small_gicp: dict[SettingName, SmallGICPSetting]
    kiss_matcher: dict[SettingName, KISSMatcherSetting]
    pointnetlk: Learned[LucasKanade, Updates]
    pcrnet: Learned[RepeatedRegression, Updates]
    deepgmr: Learned[Mixture, NoSetting]
    dcp_v1: Learned[Graph, NoSetting]
    dcp_v2: Learned[Graph, NoSetting]
    fmr: Learned[DecodedLucasKanade, Updates]
    rpmnet: Learned[RepeatedMatching, Updates]
    egst: Learned[RepeatedMatching, Updates]
    pcrdiffusion_cf: Learned[CorrespondenceFree, NoSetting]
    pcrdiffusion_cb: Learned[CorrespondenceBased, NoSetting]
