"""Which sets of answers are held against which, pair by pair."""

import pandas as pd

from pipeline.reporting.paper import RIVALS, TIMING, UNSEEN_OBJECTS
from pipeline.reporting.reading import NOISE, SET

BASES = {
    "diffusion": "diffusion=without",
    "representation": "representation=quaternion,scaling=raw",
    "fusion": "fusion=source",
    "steps": "steps=1,sampler=ddpm",
    "hypotheses": "hypotheses=1",
}
"""By ablation, the setting that its others are held against."""
NOISY = "pcrdiffusion_cb"
"""The method that is held against the others under the same noise."""


def pick_contrasts(answers: pd.DataFrame, times: pd.DataFrame) -> pd.DataFrame:
    """Hold CF and CB against every method, and each ablation's settings against its base.

    Returns:
        A row for each contrast: the columns ``SET`` of what is held against a base, those of the
        base (``table_base``, ...), and ``metrics``.
    """
    sets = pd.concat([answers, times])
    sets = sets.loc[sets["draw"] == 0, [*SET, "headline"]].drop_duplicates()
    pairs = sets.merge(sets, how="cross", suffixes=("", "_base"))
    pairs = pairs[pairs["scenario"] == pairs["scenario_base"]]
    chosen = [
        pairs[mask].assign(metrics=[metrics] * int(mask.sum()))
        for mask, metrics in (
            (_main(pairs), ("error_r_deg", "error_t")),
            (_within_ablations(pairs), ("error_r_deg", "error_t")),
            (_fused_against_constant(pairs), ("error_r_deg",)),
            (_under_the_same_noise(pairs), ("error_r_deg",)),
            (_times(pairs), ("seconds",)),
        )
    ]
    return pd.concat(chosen, ignore_index=True)


def _across(pairs: pd.DataFrame) -> pd.Series:
    ours = pairs["method"].isin([*RIVALS]) & (pairs["method"] != pairs["method_base"])
    return (
        ours & pairs["headline"] & pairs["headline_base"] & (pairs["table"] == pairs["table_base"])
    )


def _main(pairs: pd.DataFrame) -> pd.Series:
    return _across(pairs) & (pairs["table"] != TIMING.table) & (pairs["method_base"] != "identity")


def _times(pairs: pd.DataFrame) -> pd.Series:
    return _across(pairs) & (pairs["table"] == TIMING.table) & (pairs["setting"] == "paper")


def _within_ablations(pairs: pd.DataFrame) -> pd.Series:
    same = pairs["ablation"] == pairs["ablation_base"]
    same &= pairs["method"] == pairs["method_base"]
    base = pairs["setting_base"] == pairs["ablation"].map(BASES)
    return same & base & (pairs["setting"] != pairs["setting_base"])


def _fused_against_constant(pairs: pd.DataFrame) -> pd.Series:
    fused = (pairs["ablation"] == "fusion") & (pairs["scenario"] == UNSEEN_OBJECTS)
    constant = pairs["headline_base"] & (pairs["table_base"] != TIMING.table)
    return fused & constant & (pairs["method_base"] == "constant")


def _under_the_same_noise(pairs: pd.DataFrame) -> pd.Series:
    noisy = (pairs["ablation"] == NOISE) & (pairs["ablation_base"] == NOISE)
    same = noisy & (pairs["setting"] == pairs["setting_base"])
    return same & (pairs["method"] == NOISY) & (pairs["method_base"] != NOISY)
