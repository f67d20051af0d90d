"""The typed face of params.yaml: one frozen model per section, nothing optional, nothing extra."""

from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

Fraction = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
SettingName = Literal["paper", "official"]
"""The paper's iteration counts, or the authors' own settings."""


class Section(BaseModel):
    """A part of params.yaml; an unknown, missing or ill-typed key is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Run(Section):
    """What is run on what: the rows and columns of dvc.yaml's matrices."""

    scenarios: list[str]
    classical: list[str]
    learned: list[str]
    report: Literal["results", "real"]
    """Name of the tables under ``reports/``."""


class Archive(Section):
    """A public archive; without a sha256 it is fetched and refused with the digest it has."""

    url: str
    sha256: str | None


SIZES = {
    "modelnet40": {"train_per_category", "test_per_category"},
    "3dmatch": {"scenes", "fragments_per_scene", "frames_per_fragment"},
    "kitti": {"sequences", "scans_per_sequence"},
}
"""What says how large a made-up data set is, by family."""


class Acquire(Section):
    """Where a data set comes from."""

    family: Literal["modelnet40", "3dmatch", "kitti"]
    source: Literal["synthetic", "local", "download"]
    root: str | None
    archives: list[Archive]
    synthetic: dict[str, Count] | None
    """The ``SIZES`` of the made-up data set."""

    @model_validator(mode="after")
    def _source_is_told_what_it_needs(self) -> "Acquire":
        sizes, needed = self.synthetic, SIZES[self.family]
        if (sizes is not None or self.source == "synthetic") and set(sizes or {}) != needed:
            got = sorted(sizes or {})
            raise ValueError(f"synthetic of {self.family} needs {sorted(needed)}, got {got}")
        if self.source == "local" and self.root is None:
            raise ValueError("source local needs root, the folder of the data set")
        if self.source == "download" and not self.archives and self.family != "kitti":
            raise ValueError("source download needs archives, each with url and sha256")
        return self


class Split(Section):
    """Which items train, which choose the weights, which are tested on."""

    by: Literal["official", "group", "item"]
    categories: Literal["all", "halves"]
    val_fraction: Fraction
    test_fraction: Fraction
    val_groups: list[str]
    test_groups: list[str]


class PairCounts(Section):
    """How many pairs of each split; null makes one of each item."""

    train: Count | None
    val: Count | None
    test: Count | None


class Scenario(Section):
    """How pairs are made of a data set. Angles in degrees, lengths in the unit sphere's."""

    dataset: str
    split: Split
    pairs: PairCounts
    num_points: Count
    sampling: Literal["copies", "independent"]
    max_rotation_deg: Annotated[float, Field(ge=0, le=180)]
    max_translation: Annotated[float, Field(ge=0)]
    jitter_deviation: Annotated[float, Field(ge=0)]
    jitter_clip: Annotated[float, Field(ge=0)]
    keep: Annotated[float, Field(gt=0, le=1)]

    @property
    def max_rotation(self) -> float:
        """In radians."""
        return radians(self.max_rotation_deg)


class Diffusion(Section):
    """The process, and the walk back."""

    timesteps: Count
    steps: Count
    sampler: Literal["ddpm", "ddim"]

    @model_validator(mode="after")
    def _steps_fit(self) -> "Diffusion":
        if self.steps > self.timesteps:
            raise ValueError(f"steps must be at most timesteps {self.timesteps}, got {self.steps}")
        return self


class NoSetting(Section):
    """Of a method that has nothing to set."""


class ICPSetting(Section):
    """One setting of ICP."""

    max_iterations: Count
    max_distance: Positive


class FGRSetting(Section):
    """One setting of FGR; lengths in the clouds' unit."""

    iterations: Count
    max_distance: Positive
    feature_radius: Positive
    feature_neighbours: Count
    normal_radius: Positive


class CorrespondenceFree(Section):
    """The size of PCRDiffusion CF."""

    feature_dim: Count


class CorrespondenceBased(Section):
    """The encoder and decoder of PCRDiffusion CB; ``radius`` in the clouds' unit."""

    feature_dim: Annotated[int, Field(ge=4, multiple_of=4)]
    neighbours: Count
    radius: Positive
    sinkhorn_iterations: Count


class Methods(Section):
    """Per method its settings, by the name that the tables give them, or its architecture."""

    identity: dict[SettingName, NoSetting]
    constant: dict[SettingName, NoSetting]
    icp_centroid: dict[SettingName, ICPSetting]
    icp: dict[SettingName, ICPSetting]
    fgr: dict[SettingName, FGRSetting]
    pcrdiffusion_cf: CorrespondenceFree
    pcrdiffusion_cb: CorrespondenceBased


class Optimisation(Section):
    """How a method is trained; for how long is in ``epochs``."""

    batch_size: Count
    learning_rate: Positive
    schedule: Literal["plateau", "cosine"]
    patience: Count
    validate_every: Count


class Train(Section):
    """Training, one section per learned method."""

    poses: Literal["fixed", "fresh"]
    pcrdiffusion_cf: Optimisation
    pcrdiffusion_cb: Optimisation


class Ablation(Section):
    """What the ablations vary."""

    scenario: str
    steps: list[Count]


class Params(Section):
    """All of params.yaml."""

    profile: str
    seed: Annotated[int, Field(ge=0)]
    threads: Count
    run: Run
    acquire: dict[str, Acquire]
    scenarios: dict[str, Scenario]
    diffusion: Diffusion
    methods: Methods
    train: Train
    epochs: dict[str, dict[str, Count]]
    ablation: Ablation

    @model_validator(mode="after")
    def _names_agree(self) -> "Params":
        _same("run.scenarios", self.run.scenarios, "scenarios", list(self.scenarios))
        _same("epochs", list(self.epochs), "scenarios", list(self.scenarios))
        for name, scenario in self.scenarios.items():
            if scenario.dataset not in self.acquire:
                raise ValueError(f"scenarios.{name}.dataset {scenario.dataset!r} is not in acquire")
            _same(f"epochs.{name}", list(self.epochs[name]), "run.learned", self.run.learned)
        if self.ablation.scenario not in self.scenarios:
            raise ValueError(f"ablation.scenario {self.ablation.scenario!r} is not in scenarios")
        return self


def _same(a_name: str, a: Sequence[str], b_name: str, b: Sequence[str]) -> None:
    if set(a) != set(b):
        raise ValueError(f"{a_name} needs the same names as {b_name}: {set(a) ^ set(b)} differ")


Named = TypeVar("Named")


def pick(sections: Mapping[str, Named], name: str, where: str) -> Named:
    """One of several named sections.

    Raises:
        ValueError: There is none of that name.
    """
    if name not in sections:
        raise ValueError(f"params.yaml has no {where}.{name}, there are {sorted(sections)}")
    return sections[name]


def read_params(path: Path = Path("params.yaml")) -> Params:
    """Read and check params.yaml.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is not YAML, or a key is missing, unknown or ill-typed; one sentence.
    """
    try:
        return Params.model_validate(yaml.safe_load(path.read_text()))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is not YAML: {' '.join(str(error).split())}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        got = f", got {first['input']!r}" if not isinstance(first["input"], dict) else ""
        message = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"{path}: {where}: {message}{got}") from error
