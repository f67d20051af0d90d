"""Running a method, in each of its settings, over the test pairs of one scenario."""

from collections.abc import Mapping

from pcrdiff.evaluation import Estimates, Task, evaluate_all
from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.registration import Method, Pairs
from pipeline.compute.progress import bar
from pipeline.compute.workers import spread_over
from pipeline.settings.params import Params
from pipeline.settings.seeding import stream


def answer_settings(
    params: Params, settings: Mapping[str, Method], test: Pairs
) -> Mapping[str, Estimates]:
    """Register the test pairs under each setting of a method."""
    return answer_all(params, {name: (method, 0) for name, method in settings.items()}, test)


def answer(params: Params, method: Method, test: Pairs) -> Estimates:
    """Register the test pairs, each from its own seed, the same for every method."""
    (estimates,) = answer_all(params, {"": (method, 0)}, test).values()
    return estimates


def answer_all(
    params: Params,
    drawn: Mapping[str, tuple[Method, int]],
    pairs: Pairs,
    *,
    purpose: str = "evaluate",
) -> dict[str, Estimates]:
    """Register pairs under each setting: a method and the number of its draw.

    Another draw than 0, and another purpose, have seeds of their own.
    """
    tasks = [
        Task(method, stream(params.seed, purpose if draw == 0 else f"{purpose}/{draw}"))
        for method, draw in drawn.values()
    ]
    spread = spread_over(params.compute, params.threads)
    found = evaluate_all(tasks, pairs, progress=bar, spread=spread)
    return dict(zip(drawn, found, strict=True))


def mean_error_r_deg(test: Pairs, given: Estimates) -> float:
    """ERROR(R) over all pairs, failed ones included."""
    return error_r_deg(given.T_target_source, test.T_target_source).mean().item()


def headline(answers: Mapping[str, Estimates]) -> Estimates:
    """The answers in the paper's setting, or in the first where the paper has none."""
    return answers.get("paper", next(iter(answers.values())))
