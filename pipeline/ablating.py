"""The ablations: each varies one thing and answers the same test pairs every time."""

from collections.abc import Callable, Mapping
from pathlib import Path

from pcrdiff.evaluation import Estimates
from pcrdiff.registration import Pairs
from pipeline.artifacts import read_pairs
from pipeline.evaluating import answer, load_learned
from pipeline.params import Params

Answers = Mapping[str, Mapping[str, Estimates]]
"""By method, then by the varied value."""


def ablate_steps(params: Params, pairs: Path, models: Path) -> tuple[Pairs, Answers]:
    """Table 7: the steps of the walk back, of one training, for each method that walks.

    The steps that params.yaml samples with are always among them.
    """
    test = read_pairs(pairs, "test")
    steps = sorted({*params.ablation.steps, params.diffusion.steps})
    walks = {f"steps={n}": params.diffusion.model_copy(update={"steps": n}) for n in steps}
    answers = {
        name: {
            setting: answer(
                params,
                load_learned(name, "paper", params.methods, walk, models / f"{name}.safetensors"),
                test,
            )
            for setting, walk in walks.items()
        }
        for name in params.ablation.methods
    }
    return test, answers


ABLATIONS: dict[str, Callable[[Params, Path, Path], tuple[Pairs, Answers]]] = {
    "steps": ablate_steps,
}
