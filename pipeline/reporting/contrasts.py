"""Which results are held against which, pair by pair."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from pipeline.reporting.paper import RIVALS, UNSEEN_OBJECTS
from pipeline.reporting.result_files import Scores, Times, headlines

MINUS = " minus "
BASES = {
    "diffusion": "diffusion=without",
    "representation": "representation=quaternion,scaling=raw",
    "fusion": "fusion=source",
    "steps": "steps=1,sampler=ddpm",
    "hypotheses": "hypotheses=1",
}
"""By ablation, the setting that its others are held against."""
DRAW = ",draw="


@dataclass(frozen=True)
class Contrast:
    """What one method scored under one setting, held against another's on the same pairs."""

    mine: Scores | Times
    base: Scores | Times
    metrics: tuple[str, ...]

    @property
    def setting(self) -> str:
        """Name it: ``A minus B``, or ``A minus <method>:B`` against another method."""
        other = "" if self.base.method == self.mine.method else f"{self.base.method}:"
        return f"{self.mine.setting}{MINUS}{other}{self.base.setting}"

    @property
    def is_rival(self) -> bool:
        """Whether it is one of ours against a method of its family in the paper."""
        main = isinstance(self.mine, Scores) and self.mine.ablation is None
        return main and self.base.method in RIVALS.get(self.mine.method, ())

    @property
    def failures(self) -> int:
        """Pairs on which either failed."""
        mine, base = self._common()
        return int((self.mine.failed[mine] | self.base.failed[base]).sum())

    def columns(
        self, metric: str
    ) -> tuple[Float64[np.ndarray, " pairs"], Float64[np.ndarray, " pairs"]]:
        """Give the metric of both on the pairs that both have."""
        mine, base = self._common()
        return self.mine.numbers[metric][mine], self.base.numbers[metric][base]

    def _common(self) -> tuple[Int64[np.ndarray, " pairs"], Int64[np.ndarray, " pairs"]]:
        _, mine, base = np.intersect1d(
            self.mine.pair, self.base.pair, assume_unique=True, return_indices=True
        )
        return mine, base


def make_contrasts(scores: Sequence[Scores], times: Iterable[Times]) -> list[Contrast]:
    """Hold CF and CB against every method, and each ablation's settings against its base."""
    errors = ("error_r_deg", "error_t")
    main = headlines(scores)
    across = [
        Contrast(one, base, errors)
        for (scenario, method), one in main.items()
        for (where, other), base in main.items()
        if method in RIVALS and where == scenario and other not in (method, "identity")
    ]
    bases = {(one.ablation, one.scenario, one.method, one.setting): one for one in scores}
    within = [
        Contrast(one, bases[key], errors)
        for one in scores
        if one.ablation in BASES and DRAW not in one.setting
        for key in [(one.ablation, one.scenario, one.method, BASES[one.ablation])]
        if key in bases and one.setting != BASES[one.ablation]
    ]
    return [*across, *within, *_across_ablated(scores), *_of_times(list(times))]


def _across_ablated(scores: Sequence[Scores]) -> list[Contrast]:
    """Hold fusions against the constant pose, and CB under noise against others under the same."""
    constant = headlines(scores).get((UNSEEN_OBJECTS, "constant"))
    fused = [one for one in scores if (one.ablation, one.scenario) == ("fusion", UNSEEN_OBJECTS)]
    noisy = [one for one in scores if one.ablation == "noise"]
    return [
        *(Contrast(one, constant, ("error_r_deg",)) for one in fused if constant),
        *(
            Contrast(one, base, ("error_r_deg",))
            for one in noisy
            for base in noisy
            if one.method == "pcrdiffusion_cb" != base.method
            and (one.scenario, one.setting) == (base.scenario, base.setting)
        ),
    ]


def _of_times(times: Sequence[Times]) -> list[Contrast]:
    """Hold the seconds of CF and CB against those of every method, in the paper's setting."""
    paper = {one.method: one for one in times if one.setting == "paper"}
    first = paper | {one.method: one for one in times if one.method not in paper}
    return [
        Contrast(one, base, ("seconds",))
        for method, one in paper.items()
        for base in first.values()
        if method in RIVALS and base.method != method and len({*one.pair} & {*base.pair})
    ]
