"""Whether a search for the maxima in bfloat16 costs accuracy: CF trained with it and without.

Takes minutes, so it is a command of its own: ``python -m benchmarks.precision``. Where the
processor has no bfloat16 its products are computed from rounded factors, which gives the same
numbers slowly.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch

from pcrdiff.evaluation import evaluate
from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.precision import SearchPrecision, set_search_precision
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.registration import Pairs
from pcrdiff.training.budget import Budget
from pcrdiff.training.loop import Trainer, train
from pipeline.compute.checkpoints import NoCheckpoint
from pipeline.compute.machine import settle
from pipeline.compute.progress import bar
from pipeline.formats.files import write_csv
from pipeline.formats.pairs import read_pairs
from pipeline.loading import build_untrained
from pipeline.settings.params import Params, read_params

SEARCHES: tuple[SearchPrecision, ...] = ("float32", "bfloat16")
SCENARIO, METHOD = "modelnet40-unseen_objects", "pcrdiffusion_cf"
SEEDS = (0, 1, 2)
OUT = Path("benchmarks/details/precision.csv")
COLUMNS = ("search", "seed", "steps", "error_r_deg", "pairs")


def trained_error(params: Params, splits: Mapping[str, Pairs], seed: int) -> tuple[int, float]:
    """Steps, and the mean rotation error in degrees on the test pairs, of one training of CF."""
    torch.manual_seed(seed)
    network = build_untrained(METHOD, params.methods, params.diffusion)
    optimisation = getattr(params.train, METHOD).model_dump()
    budget = Budget(params.training(SCENARIO, METHOD).epochs, **optimisation)
    made = params.scenarios[SCENARIO]
    fresh = PoseRange(made.max_rotation, made.max_translation, made.min_translation)
    trainer = Trainer(network, splits["train"], splits["val"], budget, fresh, seed=seed)
    weights, curve = train(trainer, NoCheckpoint(), bar)
    network.load_state_dict(weights)
    answers = evaluate(network.eval(), splits["test"], seed=0)
    angles = error_r_deg(answers.T_target_source, splits["test"].T_target_source)
    return curve[-1].step, angles.mean().item()


def measure(params: Params, pairs: Path, seeds: Sequence[int] = SEEDS) -> list[list[object]]:
    """A row for each search and seed, in the order of ``COLUMNS``."""
    splits = {name: read_pairs(pairs, name) for name in ("train", "val", "test")}
    rows: list[list[object]] = []
    for seed in seeds:
        for search in SEARCHES:
            set_search_precision(search)
            steps, error = trained_error(params, splits, seed)
            rows.append([search, seed, steps, error, len(splits["test"])])
    return rows


def verdict(rows: Sequence[Sequence[object]]) -> str:
    """The mean difference of the two searches beside the spread over seeds."""
    found = {
        search: np.array([float(str(row[3])) for row in rows if row[0] == search])
        for search in SEARCHES
    }
    difference = float((found["bfloat16"] - found["float32"]).mean())
    spread = float(found["float32"].std(ddof=1))
    return (
        f"bfloat16 search: {difference:+.3f} deg against float32 in the mean of "
        f"{len(found['float32'])} seeds, which spread by {spread:.3f} deg"
    )


def main() -> None:
    """Train, write ``precision.csv`` and say what it comes to."""
    params = read_params()
    settle(params.threads)
    rows = measure(params, Path(f"data/pairs/{SCENARIO}.h5"))
    write_csv(OUT, [list(COLUMNS), *rows])
    print(verdict(rows))  # noqa: T201  the command's answer


if __name__ == "__main__":
    main()
