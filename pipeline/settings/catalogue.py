"""The methods there are, and their settings as ``methods`` in params.yaml holds them.

A method that learns nothing has only settings, one for each name that the tables show. A learned
one also has a network, which all its settings share. Lengths are in the clouds' unit.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Generic, Literal, TypeVar

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
    """A method has nothing to set."""


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


class RefinementParams(Section):
    """How starts are refined and verified: see ``pcrdiff.hypotheses``; lengths in the unit sphere's."""

    distances: Annotated[list[Positive], Field(min_length=1)]
    polish: Positive
    truncation: Positive
    coarse_points: Count
    finalists: Count


class RefinedSetting(Section):
    """One setting of a method that refines starts."""

    starts: Count
    refinement: RefinementParams


class MatchedSetting(RefinedSetting):
    """One setting of a method that refines starts made of matched features."""

    matching: FeatureSetting


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
    """PCRNet; ``probes`` are the points whose distance to the other cloud its loss takes."""

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


class Moved(Section):
    """PCRDiffusion CB moved; its walk is its own, apart from the one of ``diffusion``."""

    timesteps: Count
    feature_dim: MultipleOfFour
    attention_layers: Count
    sinkhorn_iterations: Count


class Walked(Section):
    """One setting of PCRDiffusion: the walk of ``diffusion``, or several as starts."""

    refined: RefinedSetting | None = None


class Steps(Walked):
    """One setting of a method that walks on its own answers."""

    steps: Count


Network = TypeVar("Network", bound=Section)
Setting = TypeVar("Setting", bound=Section)


class Learned(Section, Generic[Network, Setting]):
    """A learned method: what is trained, and in which settings the trained network answers."""

    network: Network
    settings: Annotated[dict[SettingName, Setting], Field(min_length=1)]


AnyLearned = Learned[Section, Section]


Kind = Literal["floor", "classical", "baseline", "diffused", "moved"]
"""A floor is below what any method should reach; the last three are learned, the last two ours."""


@dataclass(frozen=True)
class Entry:
    """How reports show a method."""

    shown: str
    """Its name there."""
    kind: Kind


def entry(shown: str, kind: Kind) -> Any:  # noqa: ANN401  what pydantic takes for a field
    """A method's section in params.yaml; a profile may leave out others than PCRDiffusion's."""
    default = ... if kind == "diffused" else None
    return Field(default=default, json_schema_extra={"shown": shown, "kind": kind})


Settings = dict[SettingName, Setting] | None


class Methods(Section):
    """The catalogue, in the order of the rows: a method's name, sections, name in reports, kind.

    The method itself is the class of that ``name`` in ``pcrdiff/methods/<name>.py``.
    """

    identity: Settings[NoSetting] = entry("Identity", "floor")
    constant: Settings[NoSetting] = entry("Constant (mean pose)", "floor")
    icp_centroid: Settings[ICPSetting] = entry("ICP from the centroids", "floor")
    icp: Settings[ICPSetting] = entry("ICP", "classical")
    trimmed_icp: Settings[TrimmedICPSetting] = entry("Trimmed ICP", "classical")
    gicp: Settings[ICPSetting] = entry("Generalized ICP", "classical")
    fgr: Settings[FGRSetting] = entry("FGR", "classical")
    ransac_fpfh: Settings[FeatureSetting] = entry("RANSAC on FPFH", "classical")
    small_gicp: Settings[SmallGICPSetting] = entry("small_gicp", "classical")
    kiss_matcher: Settings[KISSMatcherSetting] = entry("KISS-Matcher", "classical")
    gicp_multistart: Settings[RefinedSetting] = entry("GICP, random starts", "classical")
    ransac_multistart: Settings[MatchedSetting] = entry("GICP, FPFH triples", "classical")
    sc2_pcr: Settings[MatchedSetting] = entry("SC2-PCR", "classical")
    pointnetlk: Learned[LucasKanade, Updates] | None = entry("PointNetLK", "baseline")
    pcrnet: Learned[RepeatedRegression, Updates] | None = entry("PCRNet", "baseline")
    deepgmr: Learned[Mixture, NoSetting] | None = entry("DeepGMR", "baseline")
    dcp_v1: Learned[Graph, NoSetting] | None = entry("DCP v1", "baseline")
    dcp_v2: Learned[Graph, NoSetting] | None = entry("DCP v2", "baseline")
    fmr: Learned[DecodedLucasKanade, Updates] | None = entry("FMR", "baseline")
    rpmnet: Learned[RepeatedMatching, Updates] | None = entry("RPMNet", "baseline")
    egst: Learned[RepeatedMatching, Updates] | None = entry("EGST", "baseline")
    pcrdiffusion_cf: Learned[CorrespondenceFree, Walked] = entry("PCRDiffusion CF", "diffused")
    pcrdiffusion_cb: Learned[CorrespondenceBased, Walked] = entry("PCRDiffusion CB", "diffused")
    pcrdiffusion_cb_moved: Learned[Moved, Steps] | None = entry("PCRDiffusion CB moved", "moved")


CATALOGUE = {
    name: Entry(**field.json_schema_extra)  # type: ignore[arg-type]  # a mapping, see `entry`
    for name, field in Methods.model_fields.items()
}
"""Every method by its name, in the order of the rows."""


def names_of(*kinds: Kind) -> list[str]:
    """The methods of some kinds."""
    return sorted(name for name, entry in CATALOGUE.items() if entry.kind in kinds)
