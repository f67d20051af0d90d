"""What is measured on: pairs of one scenario with as many points as asked for, and trained weights."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from pcrdiff.registration import Pairs
from pipeline.formats.pairs import read_pairs, write_pairs
from pipeline.formats.weights import WEIGHTS
from pipeline.settings.params import PairCounts, Params
from pipeline.settings.profiles import read_profile
from stages.preprocess import preprocess

SCENARIO = "modelnet40-gaussian_noise"
PROJECT = Path()
"""Where the profile lies whose networks the training steps are measured with."""


def make_pairs(params: Params, points: int, count: int) -> dict[str, Pairs]:
    """At most ``count`` pairs of each split, with ``points`` points each, from the raw data set.

    Raises:
        FileNotFoundError: The raw data set is not there.
    """
    scenario = params.scenarios[SCENARIO]
    few = PairCounts(train=count, val=1, test=count)
    scenario = scenario.model_copy(update={"num_points": points, "pairs": few})
    family = params.acquire[scenario.dataset].family
    raw = Path("data/raw") / scenario.dataset
    made = preprocess(SCENARIO, scenario, family, raw, seed=params.seed)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "pairs.h5"
        write_pairs(file, made.splits, made.label, made.attributes)
        return {split: read_pairs(file, split) for split in made.splits}


def read_paper_params() -> Params:
    """The profile with the paper's networks."""
    return read_profile(PROJECT, "paper")


def trained_methods(params: Params) -> list[str]:
    """The methods that are trained on the scenario."""
    return [method for method, epochs in params.trainings.items() if SCENARIO in epochs]


def needed_stages(params: Params) -> Sequence[str]:
    """The stages that make the weights measured, and by way of them the raw data set."""
    learned = trained_methods(params)
    diffused = [f"train@{SCENARIO}-{name}" for name in learned if name in params.run.diffused]
    return diffused + [
        f"train_baselines@{name}" for name in learned if name in params.run.baselines
    ]


def shipped_weights(params: Params) -> list[Path]:
    """The networks that came with the code for the scenario whose starts are timed."""
    folder, name = PROJECT / "pcrdiff/weights", f"{params.timing.starts}.safetensors"
    files = [folder / method / name for method in params.run.shipped]
    return [file for file in files if file.is_file()]


def weights_of(method: str) -> Path:
    """Where a method's weights lie."""
    return Path("models") / method / SCENARIO / WEIGHTS
