"""How numbers, units and training budgets are printed, the same in every document."""

from pipeline.reporting.paper import place
from pipeline.reporting.reading import Training

HEADINGS = {
    "rmse_r_deg": "RMSE(R)",
    "rmse_t": "RMSE(t)",
    "mae_r_deg": "MAE(R)",
    "mae_t": "MAE(t)",
    "error_r_deg": "ERROR(R)",
    "error_t": "ERROR(t)",
    "median_error_r_deg": "median ERROR(R)",
    "below_5_deg_percent": "below 5°",
    "chamfer_success_percent": "Chamfer success",
    "seconds": "time",
    "peak_memory_mib": "memory",
    "spread_over_draws_deg": "spread over draws",
    "right_percent": "right",
    "calibration_error_percent": "calibration error",
    "trusted_percent": "trusted",
    "wrong_of_trusted_percent": "wrong of the trusted",
    "trusted_of_right_percent": "trusted of the right",
}
"""The metrics, in the order of the columns."""
RESOLVED_DEG = 1e-6
"""Arithmetic resolves no smaller angle between two rotations; what is smaller prints as such."""
UNRESOLVED = "< 1e-6"


def unit_of(metric: str, length: str) -> str:
    """Name the unit of a metric; ``length`` is the cloud's own."""
    units = {"percent": "%", "seconds": "s", "mib": "MiB", "deg": "deg"}
    return units.get(metric.rpartition("_")[2], length)


def show_value(metric: str, value: float) -> str:
    """Print a number as the paper does: four decimals, unless that would hide it."""
    if is_unresolved(metric, value):
        return UNRESOLVED
    if metric.endswith(("_percent", "_mib")):
        return f"{value:.1f}"
    if value == 0:
        return "0"
    return f"{value:.4f}" if abs(value) >= 5e-5 else f"{value:.0e}"


def show_bound(metric: str, value: float) -> str:
    """Print one end of an interval: about three digits."""
    return UNRESOLVED if is_unresolved(metric, value) else show_short(value)


def show_short(value: float) -> str:
    """Print a number with about three digits."""
    if value == 0:
        return "0"
    if abs(value) < 5e-4:
        return f"{value:.0e}"
    if abs(value) >= 1e5:
        return f"{value:.2e}"
    decimals = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2 if abs(value) >= 1 else 3
    return f"{value:.{decimals}f}"


def is_unresolved(metric: str, value: float) -> bool:
    """Tell an angle that is not zero, yet smaller than arithmetic resolves."""
    return metric.endswith("_deg") and 0 < abs(value) < RESOLVED_DEG


def describe_budget(training: Training) -> str:
    """Say in words what a training cost."""
    words = {
        "epochs": "{:,} epochs",
        "steps": "{:,} steps",
        "batch_size": "batches of {:,}",
        "step_points": "{:,} points of each cloud a step",
        "train_pairs": "{:,} pairs",
        "epoch_pairs": "{:,} of them an epoch",
        "parameters": "{:,} parameters",
        "best_epoch": "best epoch {:,}",
    }
    budget = dict(training.budget)
    if budget.get("epoch_pairs") == budget.get("train_pairs"):
        budget.pop("epoch_pairs", None)
    said = [text.format(budget[key]) for key, text in words.items() if key in budget]
    said = [text.removesuffix("s") if text.startswith("1 ") else text for text in said]
    if start := budget.get("start"):
        said.insert(0, f"started from the network of {place(start).title} that came with the code")
    return ", ".join(said) or "budget not recorded"
