"""Which sets of answers are held against which, pair by pair."""

import pandas as pd

from pipeline.reporting.paper import ERRORS, RIVALS, TIMING, UNSEEN_OBJECTS
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

    def agree(*names: str) -> pd.Series:
        return (pairs[[*names]] == pairs[[f"{name}_base" for name in names]].to_numpy()).all(axis=1)

    is_headline = pairs["headline"] & pairs["headline_base"] & agree("table")
    across = is_headline & pairs["method"].isin([*RIVALS]) & ~agree("method")
    timed = pairs["table"] == TIMING.table
    is_base = pairs["setting_base"] == pairs["ablation"].map(BASES)
    fused = (pairs["ablation"] == "fusion") & (pairs["scenario"] == UNSEEN_OBJECTS)
    constant = pairs["headline_base"] & (pairs["method_base"] == "constant")
    noisy = (pairs["ablation"] == NOISE) & (pairs["method"] == NOISY)
    chosen = [
        (across & ~timed & (pairs["method_base"] != "identity"), ERRORS),
        (agree("ablation", "method") & is_base & ~agree("setting"), ERRORS),
        (fused & constant & (pairs["table_base"] != TIMING.table), ERRORS[:1]),
        (noisy & agree("ablation", "setting") & ~agree("method"), ERRORS[:1]),
        (across & timed & (pairs["setting"] == "paper"), ("seconds",)),
    ]
    frames = [pairs[mask].assign(metrics=[names] * int(mask.sum())) for mask, names in chosen]
    return pd.concat(frames, ignore_index=True)
