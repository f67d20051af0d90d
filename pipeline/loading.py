"""From params and weights to the methods of ``pipeline.settings.catalogue.CATALOGUE``.

A method's module is imported when it is built: Open3D takes a second that training can spare.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from pydantic import ValidationError

from pcrdiff.diffusion.sampling import Walk
from pcrdiff.hypotheses import Refinement, VerifiedMethod
from pcrdiff.registration import LearnedMethod, Method, Pairs
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import read_facts, read_weights
from pipeline.settings.catalogue import AnyLearned, Methods
from pipeline.settings.params import (
    DIFFUSED,
    MOVED,
    Diffusion,
    Params,
    classical_names,
    learned_names,
)
from pipeline.settings.sections import Section, SettingName
from pipeline.settings.variants import AS_IT_IS, Variant

if TYPE_CHECKING:
    from pcrdiff.models.diffused import DiffusedMethod


VALIDATION_STEPS = 4
"""Of a walk on its own answers."""
SPREAD = ("constant", "gicp_multistart")
"""The methods that learn nothing but how the training poses are spread."""


def method_class(name: str) -> Callable[..., Any]:
    """The class of that ``name`` in ``pcrdiff/methods/<name>.py``."""
    found = vars(import_module(f"pcrdiff.methods.{name}")).values()
    made: Callable[..., Any] = next(each for each in found if getattr(each, "name", None) == name)
    return made


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
    given = _network(name, section, variant)
    chosen = section.settings[setting].model_dump()
    chosen.pop("refined", None)
    if name in MOVED:
        given["walk"] = _own_walk(given, chosen.pop("steps"))
    given |= chosen
    return _build(name, given, diffusion)


def _own_walk(network: dict[str, object], steps: int) -> Walk:
    """The walk of a method that goes on from its own answers, first from the mode of the noise."""
    T = cast(int, network.pop("timesteps"))
    return Walk(T, steps, "feedback", hypotheses=1, spacing="quadratic", start="mode")


def build_untrained(
    name: str, methods: Methods, diffusion: Diffusion, variant: Variant = AS_IT_IS
) -> LearnedMethod:
    """A learned method to be trained; it validates with as many updates as it trains with.

    The number is fixed, so that evaluation settings cannot influence model selection.

    Raises:
        ValueError: No such method, or the variant has a key that its network has not.
    """
    given = _network(name, _section(name, methods), variant)
    if "train_updates" in given:
        given["updates"] = given["train_updates"]
    if name in MOVED:
        given["walk"] = _own_walk(given, VALIDATION_STEPS)
    return _build(name, given, diffusion)


def _network(name: str, section: AnyLearned, variant: Variant) -> dict[str, object]:
    given = dict(section.network.model_dump())
    unknown = sorted(set(variant) - set(given))
    if unknown:
        raise ValueError(f"the network of {name} has no {', '.join(unknown)} to vary")
    return {**given, **variant}


def _build(name: str, given: dict[str, object], diffusion: Diffusion) -> LearnedMethod:
    if name in DIFFUSED:
        given["walk"] = Walk(**diffusion.model_dump())
    method: LearnedMethod = method_class(name)(**given)
    return method


def _section(name: str, methods: Methods) -> AnyLearned:
    if name not in learned_names():
        raise ValueError(f"no learned method is called {name!r}")
    section: AnyLearned = getattr(methods, name)
    return section


def build_classical(
    name: str, methods: Methods, train: Callable[[], Pairs]
) -> Mapping[str, Method]:
    """A method that learns nothing, once per setting; those of ``SPREAD`` alone ask for ``train``.

    Raises:
        ValueError: No such method.
    """
    if name not in classical_names():
        raise ValueError(f"no classical method is called {name!r}")
    sections: Mapping[str, Section] = getattr(methods, name)
    make = method_class(name)
    known = {"T_training": train().T_target_source} if name in SPREAD else {}
    return {setting: make(**known, **_given(section)) for setting, section in sections.items()}


def _given(section: Section) -> dict[str, Any]:
    """What a setting says, by the names of the method's arguments."""
    return _converted(section.model_dump())


def _converted(given: dict[str, Any]) -> dict[str, Any]:
    """The same with what the library has a class for as that class."""
    if "refinement" in given:
        refinement = given["refinement"]
        distances = tuple(refinement["distances"])
        given["refinement"] = Refinement(**{**refinement, "distances": distances})
    if "matching" in given:
        from pcrdiff.bindings.open3d_registration import FeatureMatching

        given["matching"] = FeatureMatching(**given["matching"])
    return given


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
        setting: _ready(
            load_learned(name, setting, params.methods, params.diffusion, weights),
            _section(name, params.methods).settings[setting],
        )
        for setting in settings_of(name, params.methods)
    }


def _ready(method: LearnedMethod, section: Section) -> Method:
    """The method itself, or its walks as starts of a refinement."""
    refined = section.model_dump().get("refined")
    if refined is None:
        return method
    from pcrdiff.models.refined_walks import RefinedWalks

    return RefinedWalks(cast("DiffusedMethod[Any]", method), **_converted(refined))


def load_shipped(params: Params, name: str, weights: Path) -> Mapping[str, Method]:
    """A method with weights that came with the code, in each of its settings.

    Its network is the one that the weights say; its settings are those of params.yaml.

    Raises:
        FileNotFoundError, ValueError: The weights are not there or not what they should be, or
            their network is none that this code knows.
    """
    own = _section(name, params.methods)
    try:
        told = _network_section(name).model_validate(read_facts(weights).get("network"))
    except ValidationError as error:
        raise ValueError(f"{weights} is of a network that {name} is not: {error}") from error
    section = own.model_copy(update={"network": told})
    methods = params.methods.model_copy(update={name: section})
    changed = params.model_copy(update={"methods": methods})
    return load_settings(changed, name, weights, weights)


def load_sources(
    params: Params, name: str, scenario: str, pairs: Path, shipped: Path
) -> Mapping[str, VerifiedMethod]:
    """A method of ``ablation.starts``, in those of its settings that are sources of starts.

    A learned one gets the weights that came with the code for the scenario, below ``shipped``.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be,
            or a setting refines no starts.
    """
    if name in learned_names():
        found = load_shipped(params, name, shipped / name / f"{scenario}.safetensors")
    else:
        found = load_settings(params, name, pairs, None)
    refining = {key: each for key, each in found.items() if isinstance(each, VerifiedMethod)}
    wanted = params.ablation.starts.sources[name]
    if unknown := sorted(set(wanted) - set(refining)):
        raise ValueError(
            f"ablation.starts.sources.{name} needs settings that refine starts, of which there are "
            f"{sorted(refining)}, got {unknown}"
        )
    return {setting: refining[setting] for setting in wanted}


def named_count(setting: str, count: int) -> str:
    """What results call a source of starts under a number of them."""
    return f"{setting},starts={count}"


def _network_section(name: str) -> type[Section]:
    """The section of a learned method's network, whether or not a profile may leave it out."""
    annotation = Methods.model_fields[name].annotation
    (learned,) = (each for each in get_args(annotation) or (annotation,) if each is not type(None))
    found: type[Section] = learned.model_fields["network"].annotation
    return found


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
    take_weights(method, weights)
    return method.eval()


def take_weights(method: LearnedMethod, weights: Path) -> None:
    """Give a method the weights of a file.

    Raises:
        FileNotFoundError, ValueError: The weights are not there, or are those of another network.
    """
    try:
        method.load_state_dict(read_weights(weights, method.name))
    except RuntimeError as error:
        said = f"{weights} does not fit {method.name} as params.yaml has it: {error}"
        raise ValueError(said) from error


def load_diffused(
    name: str, methods: Methods, diffusion: Diffusion, weights: Path
) -> "DiffusedMethod[Any]":
    """A trained method that walks back from noise.

    Raises:
        FileNotFoundError, ValueError: The weights are not there, or are those of another network,
            or the method does not walk.
    """
    if name not in DIFFUSED:
        raise ValueError(f"{name} does not walk back from noise")
    method = load_learned(name, "paper", methods, diffusion, weights)
    return cast("DiffusedMethod[Any]", method)
