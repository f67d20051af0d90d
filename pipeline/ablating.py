"""The ablations: each varies one thing and answers the same test pairs every time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from pcrdiff.data.corruption import jitter
from pcrdiff.evaluation import Estimates
from pcrdiff.registration import Method, Pairs
from pipeline.artifacts import read_pairs
from pipeline.evaluating import answer, load_learned, load_settings
from pipeline.params import Diffusion, Params, learned_names
from pipeline.seeding import stream
from pipeline.variants import TRAINED, setting_of, variants, weights_of

Answers = Mapping[str, Mapping[str, Estimates]]
"""By method, then by the varied value."""


@dataclass(frozen=True)
class Given:
    """What an ablation is made of."""

    params: Params
    pairs: Path
    models: Path
    """The folder with the weights of the methods, or of their variants."""

    def trained(self, name: str, diffusion: Diffusion) -> Method:
        """A method with the walk it is told of."""
        weights = self.models / f"{name}.safetensors"
        return load_learned(name, "paper", self.params.methods, diffusion, weights)


def ablate_variants(name: str, given: Given) -> tuple[Pairs, Answers]:
    """Tables 3 to 5: a training for each value, all walked back as params.yaml says."""
    params, test = given.params, read_pairs(given.pairs, "test")
    answers: dict[str, dict[str, Estimates]] = {}
    for method, variant in variants(params.ablation, name):
        weights = weights_of(given.models, method, variant)
        trained = load_learned(method, "paper", params.methods, params.diffusion, weights, variant)
        answers.setdefault(method, {})[setting_of(variant)] = answer(params, trained, test)
    return test, answers


def ablate_steps(given: Given) -> tuple[Pairs, Answers]:
    """Table 7: the steps of the walk back of one training, each walk drawn several times."""
    params, test = given.params, read_pairs(given.pairs, "test")
    answers: dict[str, dict[str, Estimates]] = {name: {} for name in params.ablation.methods}
    for name, found in answers.items():
        for sampler in params.ablation.sampling.samplers:
            for steps in params.ablation.steps:
                walk = {"steps": steps, "sampler": sampler, "hypotheses": 1}
                trained = given.trained(name, params.diffusion.model_copy(update=walk))
                for draw in range(params.ablation.sampling.draws):
                    again = f",draw={draw}" if draw else ""
                    setting = f"steps={steps},sampler={sampler}{again}"
                    found[setting] = answer(params, trained, test, draw)
    return test, answers


def ablate_hypotheses(given: Given) -> tuple[Pairs, Answers]:
    """Beyond the paper: the best fitting of several walks, chosen without the truth."""
    params, test = given.params, read_pairs(given.pairs, "test")
    walks = {
        f"hypotheses={count}": params.diffusion.model_copy(update={"hypotheses": count})
        for count in params.ablation.hypotheses
    }
    return test, {
        name: {s: answer(params, given.trained(name, walk), test) for s, walk in walks.items()}
        for name in params.ablation.methods
    }


def ablate_noise(given: Given) -> tuple[Pairs, Answers]:
    """Beyond the paper: the same test pairs under more and more noise on each cloud."""
    params, test = given.params, read_pairs(given.pairs, "test")
    noisy = {
        f"noise={deviation:g}": add_noise(test, deviation, seed=stream(params.seed, "noise"))
        for deviation in params.ablation.noise.deviations
    }
    answers = {}
    for name in params.ablation.noise.methods:
        learned = given.models / f"{name}.safetensors" if name in learned_names() else None
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
