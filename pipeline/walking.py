"""Following a walk back from noise step by step, for those who would rather look than read."""

from pathlib import Path

import torch
from torch import Tensor

from pcrdiff.diffusion.sampling import sample
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pipeline.artifacts import read_pairs
from pipeline.evaluating import load_learned
from pipeline.method_params import Methods
from pipeline.params import Diffusion, Params
from pipeline.seeding import stream
from pipeline.walks import Walk

Diffused = PCRDiffusionCF | PCRDiffusionCB


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


def load_diffused(name: str, methods: Methods, diffusion: Diffusion, weights: Path) -> Diffused:
    """A trained method that walks back from noise.

    Raises:
        FileNotFoundError, ValueError: The weights are not there, or are those of another network,
            or the method does not walk.
    """
    method = load_learned(name, "paper", methods, diffusion, weights)
    if not isinstance(method, Diffused):
        raise ValueError(f"{name} does not walk back from noise")
    return method


@torch.no_grad()
def follow(
    method: Diffused, source: Tensor, target: Tensor, *, seed: int
) -> tuple[tuple[int, ...], Tensor, Tensor]:
    """Walk one pair back as ``register`` does, and keep what it passes.

    Returns:
        The time of each step, the noisy pose before it and the prediction made from that, both
        ``[steps 4 4]`` in float64.
    """
    encoded = method.encode(source, target)
    times, noisy, predicted = list[int](), list[Tensor](), list[Tensor]()

    def denoise(x_t: Tensor, t: Tensor) -> Tensor:
        x_0 = method.denoise(x_t.to(source), t, encoded)  # type: ignore[arg-type]  # its own
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
