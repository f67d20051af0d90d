"""DVC stages ``ablate`` and ``ablate_steps``: one thing varied, everything else as it is.

The latter also keeps every pose of a few walks, for the page's slider.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import Walk, sample
from pcrdiff.evaluation import Estimates
from pcrdiff.geometry.precision import search_precision
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.registration import Method, Pairs, Poses, Sources, Targets
from pipeline.answering import answer, answer_all
from pipeline.compute.machine import settle
from pipeline.formats.answers import write_ablation
from pipeline.formats.pairs import read_pairs
from pipeline.formats.walks import RecordedWalk, write_walks
from pipeline.formats.weights import WEIGHTS
from pipeline.loading import load_diffused, load_learned
from pipeline.settings.params import Diffusion, Params, pick, read_params
from pipeline.settings.seeding import stream
from pipeline.settings.variants import TRAINED, folder_of, setting_of, variants
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register under each value, write a row for each pair."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--answers", type=Path, nargs="+", required=True, help="<ablation>.csv")
    parser.add_argument("--walks", type=Path, help="folder of the walks that the page shows")
    args = parser.parse_args(argv)

    params = read_params()
    wanted = {path: pick(ABLATIONS, path.stem, "ablation") for path in args.answers}
    settle(params.threads, params.search_precision)
    noted = {"search_precision": search_precision(), "scenario": params.ablation.scenario}
    with journal(params=noted, inputs=[args.pairs]) as notes:
        given = Given(params, read_pairs(args.pairs, "test"), args.models)
        for path, ablate in wanted.items():
            write_ablation(path, given.test, ablate(given))
            notes.artifact(path)
        if args.walks:
            write_all_walks(args.walks, given)


Answers = Mapping[str, Mapping[str, Estimates]]
"""By method, then by the varied value."""


@dataclass(frozen=True)
class Given:
    """What an ablation is made of."""

    params: Params
    test: Pairs
    models: Path
    """The folder of all weights."""

    def weights(self, method: str) -> Path:
        """Where a method's weights for the ablations' scenario lie."""
        return self.models / method / self.params.ablation.scenario / WEIGHTS

    def answer_walks(self, name: str, walks: "Walks") -> dict[str, Estimates]:
        """The answers of one training by setting: under several walks, each with its draw.

        A pair of clouds is encoded once for all of them.
        """
        walk, _ = next(iter(walks.values()))
        trained = load_diffused(name, self.params.methods, walk, self.weights(name))
        method = EncodesOnce(trained)
        drawn = {
            setting: (Walker(method, Walk(**walk.model_dump())), draw)
            for setting, (walk, draw) in walks.items()
        }
        return answer_all(self.params, drawn, self.test)


class EncodesOnce:
    """A trained method that keeps what it encoded of the last pair, for several walks."""

    def __init__(self, method: DiffusedMethod[Any]) -> None:
        self.method, self._last = method, tuple[Any, ...]()

    def encode(self, source: Tensor, target: Tensor) -> Any:  # noqa: ANN401  the method's own
        """As the method does; the same two tensors only once."""
        if not self._last or self._last[0] is not source or self._last[1] is not target:
            self._last = source, target, self.method.encode(source, target)
        return self._last[2]


class Walker(Method):
    """A trained method under one of several walks that share what it encodes."""

    def __init__(self, shared: EncodesOnce, walk: Walk) -> None:
        self.shared, self.walk = shared, walk
        self.name, self.least_points = shared.method.name, shared.method.least_points

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """Walk back from noise as the method does."""
        method, encoded = self.shared.method, self.shared.encode(source, target)
        return method.walk_back(encoded, source, target, self.walk, generator=generator)


def ablate_variants(name: str, given: Given) -> Answers:
    """Tables 3 to 5: a training for each value, all walked back as params.yaml says."""
    params = given.params
    answers: dict[str, dict[str, Estimates]] = {}
    for method, variant in variants(params, name):
        weights = given.models / folder_of(params, name, method, variant) / WEIGHTS
        trained = load_learned(method, "paper", params.methods, params.diffusion, weights, variant)
        answers.setdefault(method, {})[setting_of(variant)] = answer(params, trained, given.test)
    return answers


Walks = Mapping[str, tuple[Diffusion, int]]
"""Walks back by their setting, each with the number of its draw."""


def ablate_walks(walks_of: Callable[[Params, str], Walks], given: Given) -> Answers:
    """One training of each method under the walks that ``walks_of`` gives for it."""
    params = given.params
    return {
        name: given.answer_walks(name, walks_of(params, name)) for name in params.ablation.methods
    }


def walks_in_steps(params: Params, method: str) -> Walks:
    """Table 7: every sampler in every number of steps, drawn several times."""
    sampling = params.ablation.sampling
    walks = {}
    for sampler, steps in product(sampling.samplers, params.ablation.steps):
        varied = {"steps": steps, "sampler": sampler, "hypotheses": 1}
        walk = params.diffusion.model_copy(update=varied)
        for draw in range(sampling.draws[method]):
            again = f",draw={draw}" if draw else ""
            walks[f"steps={steps},sampler={sampler}{again}"] = walk, draw
    return walks


def walks_with_hypotheses(params: Params, _method: str) -> Walks:
    """Beyond the paper: the best fitting of several walks, chosen without the truth."""
    return {
        f"hypotheses={count}": (params.diffusion.model_copy(update={"hypotheses": count}), 0)
        for count in params.ablation.hypotheses
    }


ABLATIONS: dict[str, Callable[[Given], Answers]] = {
    **{name: partial(ablate_variants, name) for name in TRAINED},
    "steps": partial(ablate_walks, walks_in_steps),
    "hypotheses": partial(ablate_walks, walks_with_hypotheses),
}


def write_all_walks(folder: Path, given: Given) -> None:
    """Write ``<scenario>/<method>.csv``: two rows per step, the noisy pose and the prediction."""
    scenario = given.params.ablation.scenario
    for method in given.params.ablation.methods:
        walks = follow_walks(given.params, method, given.test, given.weights(method))
        write_walks(folder / scenario / f"{method}.csv", walks)


def follow_walks(params: Params, method: str, test: Pairs, weights: Path) -> list[RecordedWalk]:
    """The walks of a few test pairs, evenly chosen, with the first sampler of Table 7.

    Raises:
        FileNotFoundError, ValueError: The weights are not there or not what they should be.
    """
    shown = params.ablation.walk
    sampler = params.ablation.sampling.samplers[0]
    varied = {"steps": shown.steps, "sampler": sampler, "hypotheses": 1}
    diffusion = params.diffusion.model_copy(update=varied)
    trained = load_diffused(method, params.methods, diffusion, weights)
    chosen = torch.linspace(0, len(test) - 1, min(shown.pairs, len(test))).round().long().tolist()
    walks = []
    for pair in dict.fromkeys(chosen):
        seed = stream(params.seed, f"walk/{pair}")
        clouds = test.source[pair : pair + 1], test.target[pair : pair + 1]
        times, noisy, predicted = follow(trained, *clouds, seed=seed)
        walks.append(RecordedWalk(method, pair, times, noisy.numpy(), predicted.numpy()))
    return walks


@torch.no_grad()
def follow(
    method: DiffusedMethod[Any], source: Tensor, target: Tensor, *, seed: int
) -> tuple[tuple[int, ...], Tensor, Tensor]:
    """Walk one pair back as ``register`` does, and keep every step.

    Returns:
        The time of each step, the noisy pose before it and the prediction made from that, both
        ``[steps 4 4]`` in float64.
    """
    encoded = method.encode(source, target)
    times, noisy, predicted = list[int](), list[Tensor](), list[Tensor]()

    def denoise(x_t: Tensor, t: Tensor) -> Tensor:
        x_0 = method.denoise(x_t.to(source), t, encoded)
        times.append(int(t[0]))
        noisy.append(x_t)
        predicted.append(x_0)
        return x_0

    generator = torch.Generator().manual_seed(seed)
    sample(denoise, 1, method.space.dim, method.walk, generator=generator)
    noisy_poses, predicted_poses = (
        method.space.decode(torch.cat(vectors).double()) for vectors in (noisy, predicted)
    )
    return tuple(times), noisy_poses, predicted_poses
