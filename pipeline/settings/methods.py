"""The settings of the methods, as ``methods`` in params.yaml holds them.

A method that learns nothing has only settings, one for each name that the tables show. A learned
one also has a network, which all its settings share. Lengths are in the clouds' unit.
"""

from typing import Annotated, Generic, TypeVar

from pydantic import Field

from pipeline.settings.sections import (
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
    """The methods, by their names in the tables; those that a profile does not run may be left out."""

    identity: dict[SettingName, NoSetting] | None = None
    constant: dict[SettingName, NoSetting] | None = None
    icp_centroid: dict[SettingName, ICPSetting] | None = None
    icp: dict[SettingName, ICPSetting] | None = None
    trimmed_icp: dict[SettingName, TrimmedICPSetting] | None = None
    gicp: dict[SettingName, ICPSetting] | None = None
    fgr: dict[SettingName, FGRSetting] | None = None
    ransac_fpfh: dict[SettingName, FeatureSetting] | None = None
    small_gicp: dict[SettingName, SmallGICPSetting] | None = None
    kiss_matcher: dict[SettingName, KISSMatcherSetting] | None = None
    pointnetlk: Learned[LucasKanade, Updates] | None = None
    pcrnet: Learned[RepeatedRegression, Updates] | None = None
    deepgmr: Learned[Mixture, NoSetting] | None = None
    dcp_v1: Learned[Graph, NoSetting] | None = None
    dcp_v2: Learned[Graph, NoSetting] | None = None
    fmr: Learned[DecodedLucasKanade, Updates] | None = None
    rpmnet: Learned[RepeatedMatching, Updates] | None = None
    egst: Learned[RepeatedMatching, Updates] | None = None
    pcrdiffusion_cf: Learned[CorrespondenceFree, NoSetting]
    pcrdiffusion_cb: Learned[CorrespondenceBased, NoSetting]
