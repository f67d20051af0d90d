"""DVC stage ``ablate_noise``: one method on the same test pairs under more and more noise.

Beyond the paper.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from pcrdiff.geometry.precision import search_precision
from pcrdiff.pairs.corruption import jitter
from pcrdiff.registration import Pairs
from pipeline.answering import answer
from pipeline.compute.machine import settle
from pipeline.formats.answers import write_ablation
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import WEIGHTS
from pipeline.loading import load_settings
from pipeline.settings.params import learned_names, read_params
from pipeline.settings.seeding import stream
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and weights, register under each deviation, write a row for each pair."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--models", type=Path, required=True, help="folder of all weights")
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params, name = read_params(), args.method
    noise = params.ablation.noise
    settle(params.threads, params.search_precision)
    shown = {"search_precision": search_precision(), "method": name, "scenario": noise.scenario}
    with journal(params=shown, inputs=[args.pairs]) as notes:
        learned = name in learned_names()
        weights = args.models / name / noise.scenario / WEIGHTS if learned else None
        method = next(iter(load_settings(params, name, args.pairs, weights).values()))
        test, seed = read_pairs(args.pairs, "test"), stream(params.seed, "noise")
        answers = {
            f"noise={deviation:g}": answer(params, method, add_noise(test, deviation, seed=seed))
            for deviation in noise.deviations
        }
        measured = replace(test, shape=None)  # its clouds are not those that were registered
        write_ablation(args.answers, measured, {name: answers})
        notes.artifact(args.answers)


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
