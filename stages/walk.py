"""DVC stage ``walk``: the pose at every step of a few walks back from noise."""

import argparse
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import sample
from pcrdiff.geometry.precision import search_precision
from pcrdiff.models.diffused import DiffusedMethod
from pipeline.catalogue import load_diffused
from pipeline.compute.machine import settle
from pipeline.formats.pairs import read_pairs
from pipeline.formats.walks import Walk, write_walks
from pipeline.formats.weights import WEIGHTS
from pipeline.settings.params import Params, read_params
from pipeline.settings.seeding import stream
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, walk back, write two rows a step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--walks", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    scenario = params.ablation.scenario
    noted = params.ablation.walk.model_dump() | {"search_precision": search_precision()}
    with journal(params=noted, inputs=[args.pairs]):
        for method in params.ablation.methods:
            weights = args.models / method / scenario / WEIGHTS
            walks = follow_walks(params, method, args.pairs, weights)
            write_walks(args.walks / scenario / f"{method}.csv", walks)


def follow_walks(params: Params, method: str, pairs: Path, weights: Path) -> list[Walk]:
    """The walks of a few test pairs, evenly chosen, with the sampler of params.yaml.

    Raises:
        FileNotFoundError, ValueError: The pairs or weights are not there or not what they should be.
    """
    shown = params.ablation.walk
    steps = {"steps": shown.steps, "hypotheses": 1}
    diffusion = params.diffusion.model_copy(update=steps)
    trained = load_diffused(method, params.methods, diffusion, weights)
    test = read_pairs(pairs, "test")
    chosen = torch.linspace(0, len(test) - 1, min(shown.pairs, len(test))).round().long().tolist()
    walks = []
    for pair in dict.fromkeys(chosen):
        seed = stream(params.seed, f"walk/{pair}")
        clouds = test.source[pair : pair + 1], test.target[pair : pair + 1]
        times, noisy, predicted = follow(trained, *clouds, seed=seed)
        walks.append(Walk(method, pair, times, noisy.numpy(), predicted.numpy()))
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
