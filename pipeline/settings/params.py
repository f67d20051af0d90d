"""The typed face of params.yaml: one frozen model per section, nothing extra."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from math import radians
from pathlib import Path
from reprlib import Repr
from typing import Annotated, Literal, TypeVar

from pydantic import ConfigDict, Field, ValidationError, model_validator

from pipeline.formats.yaml_files import read_yaml
from pipeline.settings.catalogue import CATALOGUE, Methods, names_of
from pipeline.settings.sections import (
    Count,
    Distinct,
    Fraction,
    Fusion,
    Length,
    Listed,
    Name,
    Normals,
    Positive,
    Representation,
    Sampler,
    Scaling,
    SearchPrecision,
    Section,
    SettingName,
    WithOrWithout,
    Workers,
)

Named = TypeVar("Named")


class Run(Section):
    """Which scenarios there are, and which methods are run on them."""

    scenarios: Distinct[str]
    trained: Distinct[str]
    """Those of them that PCRDiffusion as the paper has it is trained on."""
    diffused: Listed[str]
    """PCRDiffusion as the paper has it."""
    baselines: Distinct[str]
    """The other learned methods, each trained on the scenarios that ``trainings`` gives it."""
    classical: Distinct[str]
    shipped: Distinct[str]
    """Learned methods whose weights came with the code; answer the scenarios that these are for."""


class Compute(Section):
    """Where independent work is done: pairs made, registered, ablated. No result depends on it."""

    workers: Workers
    """One-threaded processes on this machine; of those with several ``threads`` there are fewer."""
    scheduler: Annotated[str, Field(pattern=r"^(tcp|tls)://\S+:\d+$")] | None
    """Address of a ``dask scheduler`` whose workers do it instead."""


class ArchiveParams(Section):
    """A public archive; without a sha256 it is fetched and refused with the digest it has."""

    url: str
    sha256: str | None


SIZES = {
    "modelnet40": {"train_per_category", "test_per_category"},
    "3dmatch": {"scenes", "fragments_per_scene", "frames_per_fragment"},
    "kitti": {"sequences", "scans_per_sequence"},
}
"""What says how large a synthetic data set is, by family."""


class Acquire(Section):
    """Where a data set comes from."""

    family: Literal["modelnet40", "3dmatch", "kitti"]
    source: Literal["synthetic", "local", "download"]
    root: str | None
    archives: list[ArchiveParams]
    synthetic: dict[str, Count] | None
    """The ``SIZES`` of the synthetic data set."""

    @model_validator(mode="after")
    def _source_has_what_it_needs(self) -> "Acquire":
        sizes, needed = self.synthetic, SIZES[self.family]
        if (sizes is not None or self.source == "synthetic") and set(sizes or {}) != needed:
            got = sorted(sizes or {})
            raise ValueError(f"synthetic of {self.family} needs {sorted(needed)}, got {got}")
        if self.source == "local" and self.root is None:
            raise ValueError("source local needs root, the folder of the data set")
        if self.source == "download" and not self.archives and self.family != "kitti":
            raise ValueError("source download needs archives, each with url and sha256")
        return self


class SplitParams(Section):
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
    split: SplitParams
    pairs: PairCounts
    num_points: Count
    sampling: Literal["copies", "independent"]
    max_rotation_deg: Annotated[float, Field(ge=0, le=180)] | None
    """Each Euler angle is uniform in [0, this]; null draws uniformly from all of SO(3)."""
    min_translation: Annotated[float, Field(ge=-1e9, le=1e9)]
    max_translation: Length
    jitter_deviation: Length
    jitter_clip: Length
    keep: Annotated[float, Field(gt=0, le=1)]
    normals: Normals
    """``given`` keeps the data set's own in the pair file, for methods whose ``normals`` are ``given``."""
    degenerate: Literal["refuse", "drop"]
    """What becomes of a shape whose points are on one line or in one place."""

    @property
    def max_rotation(self) -> float | None:
        """In radians."""
        return None if self.max_rotation_deg is None else radians(self.max_rotation_deg)

    @model_validator(mode="after")
    def _translations_rise(self) -> "Scenario":
        low, high = self.min_translation, self.max_translation
        if low > high:
            raise ValueError(f"min_translation must be at most max_translation {high}, got {low}")
        return self


class Diffusion(Section):
    """The process, and the walk back."""

    timesteps: Count
    steps: Count
    sampler: Sampler
    hypotheses: Count
    """Random starts of a walk; the answer under which the clouds fit best is kept."""

    @model_validator(mode="after")
    def _steps_fit(self) -> "Diffusion":
        if self.steps > self.timesteps:
            raise ValueError(f"steps must be at most timesteps {self.timesteps}, got {self.steps}")
        return self


class Optimisation(Section):
    """How a method is trained; for how long is in ``trainings``."""

    batch_size: Count
    learning_rate: Positive
    schedule: Literal["plateau", "cosine"]
    patience: Count
    validate_every: Count
    epoch_pairs: Count | None
    """Training pairs in an epoch, drawn again for each; null takes all of them."""
    points: Count | None = None
    """Points of each cloud in a training step; null takes all of them."""


class TrainingParams(Section):
    """How long a method is trained on a scenario, and from where; an integer alone is its epochs."""

    epochs: Count
    start: Name | None = None
    """The scenario whose network of the method, which came with the code, it starts from; or fresh."""

    @model_validator(mode="before")
    @classmethod
    def _epochs_alone(cls, given: object) -> object:
        return given if isinstance(given, Mapping | TrainingParams) else {"epochs": given}


class Train(Section):
    """Training, with one ``Optimisation`` for each learned method that is trained, by its name."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Optimisation]
    devices: Workers
    """Processes on each host, each with a batch of its own; on GPUs where there are any."""
    nodes: Workers
    """Hosts."""
    poses: Literal["fixed", "fresh"]


DIFFUSED = tuple(name for name, row in CATALOGUE.items() if row.kind == "diffused")
"""The methods that walk a pose back from noise."""
MOVED = names_of("moved")
"""The methods that do so on their own answers, in a walk of their own."""
SHOWN = {name: name.removeprefix("pcrdiffusion_") for name in DIFFUSED}
"""What the headline numbers call them."""


class Sampling(Section):
    """The samplers and draws of the ablation over steps."""

    samplers: Listed[Sampler]
    draws: dict[str, Count]
    """How many times each walk of a method is drawn, so that the spread is seen."""


class Noise(Section):
    """The ablation over noise, which is added to the pairs of a scenario without any."""

    scenario: str
    """On whose pairs the learned methods were trained."""
    methods: Distinct[str]
    deviations: Listed[Length]


class Starts(Section):
    """The ablation over the number of start poses, by where they come from.

    ``sources`` are settings, by method, that refine starts; a learned one's network is the one that
    came with the code for the scenario.
    """

    scenarios: Distinct[str]
    pairs: Count
    """Test pairs of each scenario, at most."""
    counts: Listed[Count]
    sources: dict[str, Listed[SettingName]]


class WalkShown(Section):
    """The walks whose every pose the page shows."""

    steps: Count
    pairs: Count


class Ablation(Section):
    """What the ablations vary, and of which methods on which scenario.

    Variants (of diffusion, representation and fusion) are trained for ``epochs`` of their own.
    """

    scenario: str
    methods: Listed[str]
    epochs: dict[str, Count]
    diffusions: Distinct[WithOrWithout]
    """Others than the networks' own, which is trained with the representations."""
    representations: Listed[Representation]
    scalings: Listed[Scaling]
    fusions: Distinct[Fusion]
    """Others than CF's own."""
    steps: Listed[Count]
    sampling: Sampling
    hypotheses: Listed[Count]
    noise: Noise
    starts: Starts
    walk: WalkShown


class Timing(Section):
    """Table 6: batch 1, a number of pairs of one scenario; of ``ablation.starts`` on another."""

    scenario: str
    starts: str
    pairs: Count
    warm_up: Count


class Params(Section):
    """All of params.yaml."""

    profile: str
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    threads: Workers
    search_precision: SearchPrecision
    compute: Compute
    run: Run
    acquire: dict[Name, Acquire]
    scenarios: dict[Name, Scenario]
    diffusion: Diffusion
    methods: Methods
    train: Train
    trainings: dict[str, dict[str, TrainingParams]]
    """Of each learned method, by scenario."""
    ablation: Ablation
    timing: Timing

    @model_validator(mode="after")
    def _names_agree(self) -> "Params":
        _differ_in_more_than_case("acquire", self.acquire)
        _differ_in_more_than_case("scenarios", self.scenarios)
        if other := set(self.run.scenarios) ^ set(self.scenarios):
            raise ValueError(f"run.scenarios needs the same names as scenarios: {other} differ")
        self._check_scenarios()
        self._check_what_is_named()
        self._check_trainings()
        return self

    def _check_scenarios(self) -> None:
        """Every scenario has its data set, and every scenario that is named exists."""
        for name, scenario in self.scenarios.items():
            if scenario.dataset not in self.acquire:
                raise ValueError(f"scenarios.{name}.dataset {scenario.dataset!r} is not in acquire")
        named = [(f"trainings.{name}", each) for name, on in self.trainings.items() for each in on]
        named += [("run.trained", name) for name in self.run.trained]
        named += [("ablation.starts.scenarios", name) for name in self.ablation.starts.scenarios]
        named += [
            ("ablation.scenario", self.ablation.scenario),
            ("ablation.noise.scenario", self.ablation.noise.scenario),
            ("timing.scenario", self.timing.scenario),
            ("timing.starts", self.timing.starts),
        ]
        for where, name in named:
            if name not in self.scenarios:
                raise ValueError(f"{where} {name!r} is not in scenarios")

    def _check_trainings(self) -> None:
        for method in self.run.baselines:
            if not self.trainings.get(method):
                raise ValueError(f"run.baselines needs trainings.{method}, which is not there")
        run, ablation, noise = self.run, self.ablation, self.ablation.noise
        needed = [("run.diffused", *each) for each in product(run.diffused, run.trained)]
        needed += [("ablation.methods", method, ablation.scenario) for method in ablation.methods]
        learned = [method for method in noise.methods if method in learned_names()]
        needed += [("ablation.noise.methods", method, noise.scenario) for method in learned]
        for where, method, scenario in needed:
            if scenario not in self.trainings.get(method, {}):
                raise ValueError(f"{where} needs trainings.{method}.{scenario}, which is not there")
        for method, scenarios in self.trainings.items():
            for scenario in scenarios:
                self._check_normals(scenario, method)

    def _check_what_is_named(self) -> None:
        """Every method that is named exists and is of the kind that is needed.

        DVC makes paths and commands of these names too.
        """
        named: list[tuple[str, Iterable[str], Sequence[str]]] = [
            ("run.diffused", self.run.diffused, DIFFUSED),
            ("run.baselines", self.run.baselines, names_of("baseline", "moved")),
            ("train", self.train.__pydantic_extra__, learned_names()),
            ("trainings", self.trainings, learned_names()),
            ("run.shipped", self.run.shipped, learned_names()),
            ("run.classical", self.run.classical, classical_names()),
            ("ablation.methods", self.ablation.methods, DIFFUSED),
            ("ablation.noise.methods", self.ablation.noise.methods, sorted(CATALOGUE)),
            ("ablation.starts.sources", self.ablation.starts.sources, sorted(CATALOGUE)),
        ]
        for where, methods, known in named:
            for method in methods:
                if method not in known:
                    raise ValueError(f"{where} needs some of {list(known)}, got {method!r}")
        self._check_sections()
        self._check_ablated_methods()

    def _check_sections(self) -> None:
        """What is run has its section in ``methods``, what is trained in ``train`` too."""
        run, ablation = self.run, self.ablation
        ablated = *ablation.methods, *ablation.noise.methods
        for method in (*run.diffused, *run.baselines, *run.classical, *ablated):
            for name in ("methods", "train") if method in learned_names() else ("methods",):
                self._check_section(name, method)
        for method in (*run.shipped, *ablation.starts.sources):
            self._check_section("methods", method)

    def _check_section(self, name: str, method: str) -> None:
        if getattr(getattr(self, name), method, None) is None:
            raise ValueError(f"{method} needs a section {name}.{method}, there is none")

    def _check_ablated_methods(self) -> None:
        ablation = self.ablation
        numbers = {
            "ablation.epochs": ablation.epochs,
            "ablation.sampling.draws": ablation.sampling.draws,
        }
        for method in ablation.methods:
            for name, given in numbers.items():
                if method not in given:
                    raise ValueError(f"{name} needs a number for {method}, has {sorted(given)}")
            self._check_varied(method)

    def _check_varied(self, method: str) -> None:
        """The method as it is is trained once, as one of the representations in one scaling."""
        network, ablation = getattr(self.methods, method).network, self.ablation
        for key in ("representation", "scaling", "diffusion", "fusion"):
            own, where = getattr(network, key, None), f"methods.{method}.network.{key}"
            listed, among = f"{key}s", key in ("representation", "scaling")
            if (own in getattr(ablation, listed)) != among:
                needed = f"{where} among them" if among else f"others than {where}"
                raise ValueError(f"ablation.{listed} needs {needed}, which is {own}")

    def _check_normals(self, scenario: str, method: str) -> None:
        kept = self.scenarios[scenario].normals
        if getattr(getattr(self.methods, method).network, "normals", kept) == "given" != kept:
            raise ValueError(
                f"methods.{method}.network.normals is given, which needs "
                f"scenarios.{scenario}.normals to be given, got {kept}"
            )

    def training(self, scenario: str, method: str) -> TrainingParams:
        """How a learned method is trained on a scenario.

        Raises:
            ValueError: It is not trained there.
        """
        return pick(pick(self.trainings, method, "trainings"), scenario, f"trainings.{method}")


def shown_scenario(name: str) -> str:
    """What the headline numbers call a scenario."""
    return name.removeprefix("modelnet40-")


def learned_names() -> list[str]:
    """The methods that are trained."""
    return names_of("baseline", "diffused", "moved")


def classical_names() -> list[str]:
    """The methods that are not trained."""
    return names_of("floor", "classical")


def _differ_in_more_than_case(where: str, names: Iterable[str]) -> None:
    """Some disks take such names for one."""
    seen: dict[str, str] = {}
    for name in names:
        other = seen.setdefault(name.lower(), name)
        if other != name:
            raise ValueError(f"{where} has {other!r} and {name!r}, which differ in case only")


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
    return check_params(read_yaml(path), path)


def check_params(values: object, path: Path) -> Params:
    """Return the params that the content of a file stands for.

    Args:
        values: The content.
        path: The file, for the sentence that refuses it.

    Raises:
        ValueError: A key is missing, unknown or ill-typed; one sentence.
    """
    try:
        return Params.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"] if part != "[key]") or "the file"
        got = f", got {_shown(first['input'])}" if not isinstance(first["input"], dict) else ""
        message = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"{path}: {' '.join(where.split())}: {message}{got}") from error


def _shown(value: object) -> str:
    """Return the beginning of a value's repr; of a list or a number of any length, too."""
    short = Repr()
    short.maxstring = short.maxlong = short.maxother = 100
    try:
        return short.repr(value)
    except ValueError:  # Python writes out no integer of thousands of digits
        return "thousands of digits"
