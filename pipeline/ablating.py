"""The ablations: each varies one thing and answers the same test pairs every time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.data.corruption import jitter
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.evaluation import Estimates
from pcrdiff.registration import Pairs
from pipeline.artifacts import WEIGHTS, read_pairs
from pipeline.evaluating import answer, answer_all, load_learned, load_settings
from pipeline.params import Diffusion, Params, learned_names
from pipeline.seeding import stream
from pipeline.variants import TRAINED, folder_of, setting_of, variants
from pipeline.walking import Diffused, load_diffused

Answers = Mapping[str, Mapping[str, Estimates]]
"""By method, then by the varied value."""


@dataclass(frozen=True)
class Given:
    """What an ablation is made of."""

    params: Params
    pairs: Path
    models: Path
    """The folder of all weights."""

    def weights(self, scenario: str, method: str) -> Path:
        """Where a method's weights for a scenario lie."""
        return self.models / method / scenario / WEIGHTS

    def answer_walks(
        self, name: str, test: Pairs, walks: Mapping[str, tuple[Diffusion, int]]
    ) -> dict[str, Estimates]:
        """The answers of one training by setting: under several walks, each with its draw.

        A pair of clouds is encoded once for all of them.
        """
        weights = self.weights(self.params.ablation.scenario, name)
        walk, _ = next(iter(walks.values()))
        method = EncodesOnce(load_diffused(name, self.params.methods, walk, weights))
        drawn = {
            setting: (Walker(name, method, Walk(**walk.model_dump())), draw)
            for setting, (walk, draw) in walks.items()
        }
        return answer_all(self.params, drawn, test)


class EncodesOnce:
    """A method that remembers how it encoded the pair that it was shown last."""

    def __init__(self, method: Diffused) -> None:
        self.method, self._last = method, tuple[Any, ...]()

    def encode(self, source: Tensor, target: Tensor) -> Any:  # noqa: ANN401  the method's own
        """As the method does; these very tensors only once."""
        if not self._last or self._last[0] is not source or self._last[1] is not target:
            encode = type(self.method).encode
            self._last = source, target, encode(self.method, source, target)  # type: ignore[arg-type]
        return self._last[2]


@dataclass
class Walker:
    """A trained method under one of several walks that share what it encodes."""

    name: str
    shared: EncodesOnce
    walk: Walk

    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """As :class:`pcrdiff.registration.Method` asks."""
        method = self.shared.method
        method.walk = self.walk
        method.encode = self.shared.encode  # type: ignore[method-assign]
        try:
            return method.register(source, target, generator=generator)
        finally:
            del method.encode  # what is pickled has none of this


def ablate_variants(name: str, given: Given) -> tuple[Pairs, Answers]:
    """Tables 3 to 5: a training for each value, all walked back as params.yaml says."""
    params, test = given.params, read_pairs(given.pairs, "test")
    answers: dict[str, dict[str, Estimates]] = {}
    for method, variant in variants(params.ablation, name):
        weights = given.models / "ablations" / name / folder_of(name, method, variant) / WEIGHTS
        trained = load_learned(method, "paper", params.methods, params.diffusion, weights, variant)
        answers.setdefault(method, {})[setting_of(variant)] = answer(params, trained, test)
    return test, answers


def ablate_steps(given: Given) -> tuple[Pairs, Answers]:
    """Table 7: the steps of the walk back of one training, each walk drawn several times."""
    ablation, test = given.params.ablation, read_pairs(given.pairs, "test")
    return test, {
        name: given.answer_walks(name, test, walks_of(given.params, ablation.sampling.draws[name]))
        for name in ablation.methods
    }


def walks_of(params: Params, draws: int) -> dict[str, tuple[Diffusion, int]]:
    """Every walk of Table 7 by its setting, and the number of its draw."""
    sampling = params.ablation.sampling
    walks = {}
    for sampler, steps in product(sampling.samplers, params.ablation.steps):
        told = {"steps": steps, "sampler": sampler, "hypotheses": 1}
        walk = params.diffusion.model_copy(update=told)
        for draw in range(draws):
            again = f",draw={draw}" if draw else ""
            walks[f"steps={steps},sampler={sampler}{again}"] = walk, draw
    return walks


def ablate_hypotheses(given: Given) -> tuple[Pairs, Answers]:
    """Beyond the paper: the best fitting of several walks, chosen without the truth."""
    ablation, diffusion = given.params.ablation, given.params.diffusion
    test = read_pairs(given.pairs, "test")
    walks = {
        f"hypotheses={count}": (diffusion.model_copy(update={"hypotheses": count}), 0)
        for count in ablation.hypotheses
    }
    return test, {name: given.answer_walks(name, test, walks) for name in ablation.methods}


def ablate_noise(given: Given) -> tuple[Pairs, Answers]:
    """Beyond the paper: the same test pairs under more and more noise on each cloud."""
    params, test = given.params, read_pairs(given.pairs, "test")
    scenario = params.ablation.noise.scenario
    noisy = {
        f"noise={deviation:g}": add_noise(test, deviation, seed=stream(params.seed, "noise"))
        for deviation in params.ablation.noise.deviations
    }
    answers = {}
    for name in params.ablation.noise.methods:
        learned = given.weights(scenario, name) if name in learned_names() else None
        method = next(iter(load_settings(params, name, given.pairs, learned).values()))
        answers[name] = {s: answer(params, method, pairs) for s, pairs in noisy.items()}
    return test, answers


def add_noise(pairs: Pairs, deviation: float, *, seed: int) -> Pairs:
    """The same pairs with Gaussian noise on every point of both clouds.

    A pair draws the same standard normal numbers for every deviation.
    """
    if deviation == 0:
        return pairs
    source, target = list[Tensor](), list[Tensor]()
    for k in range(len(pairs)):
        generator = np.random.default_rng([seed, k])
        for cloud, noisy in ((pairs.source[k], source), (pairs.target[k], target)):
            points = jitter(cloud.double().numpy(), deviation, 5 * deviation, generator=generator)
            noisy.append(torch.from_numpy(points).to(cloud))
    return replace(pairs, source=torch.stack(source), target=torch.stack(target))


ABLATIONS: dict[str, Callable[[Given], tuple[Pairs, Answers]]] = {
    **{name: partial(ablate_variants, name) for name in TRAINED},
    "steps": ablate_steps,
    "hypotheses": ablate_hypotheses,
    "noise": ablate_noise,
}
