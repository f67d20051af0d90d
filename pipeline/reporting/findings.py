"""What the results say of each claim of the paper: the page "What we found".

The rule of the verdicts is ``RULE``; it is printed above the findings.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.reporting.paper import (
    MAE_AND_ERROR,
    PRINTED,
    RIVALS,
    SCENARIOS,
    TIMING,
    UNSEEN_OBJECTS,
    Number,
    method_rank,
    place,
    shown,
)
from pipeline.reporting.tables import IMPROVEMENT, Row
from pipeline.reporting.views import natural, setting_rank, spread
from pipeline.reporting.weighing import ELSEWHERE as ELSEWHERE
from pipeline.reporting.weighing import (
    NO_DIFFERENCE_DEG,
    Numbers,
    above,
    below,
    listed,
    said,
    say,
    weigh,
    weigh_same,
    weigh_some,
)
from pipeline.reporting.weighing import RULE as RULE
from pipeline.reporting.weighing import Verdict as Verdict

CF, CB = "pcrdiffusion_cf", "pcrdiffusion_cb"
FAMILY = {CF: "correspondence-free", CB: "correspondence-based"}
HALF_PERCENT = 50.0
ONE_STEP = "steps=1,sampler=ddpm"
NOISY = ("extra", UNSEEN_OBJECTS, CB)
"""Table, scenario and method of the ablation ``noise``."""
SPEEDS = {
    CF: "Table 6: below 1e-10 s, less than one operation of a processor takes",
    CB: "Table 6: 0.0986 s; but it prints 0.0042 s for ICP and 0.0916 s for FGR",
}
UNWEIGHED = ("quick", "tables")
"""Profiles that train too little for a verdict."""
FULL_OVERLAP = tuple(name for name, at in SCENARIOS.items() if at.table in ("1a", "1b", "1c", "2"))


@dataclass(frozen=True)
class Finding:
    """One claim, and what our numbers say of it."""

    topic: str
    """Order of methods, diffusion, representation, fusion, steps, speed, ..."""
    claim: str
    """What the paper says, with its numbers."""
    ours: tuple[str, ...]
    """Sentences, each with a number and its interval."""
    verdict: Verdict


def make_findings(rows: Sequence[Row]) -> list[Finding]:
    """Weigh every claim of the paper against the rows of ``results.csv``."""
    numbers = Numbers(rows)
    families = [(CF, name) for name in SCENARIOS if _printed(name, CF) is not None]
    return [
        *(_best_of_all(numbers, name) for name in SCENARIOS if _printed(name, CB) is not None),
        *(_best_of_family(numbers, name, method) for method, name in families),
        *(_improves_by_half(numbers, method) for method in (CF, CB)),
        _full_overlap(numbers),
        *(_diffusion(numbers, method) for method in (CF, CB)),
        _euler(numbers),
        _concat(numbers),
        _fused_with_target(numbers),
        *_steps(numbers, rows),
        *(_fastest(numbers, method) for method in (CF, CB)),
        _noise(numbers),
    ]


def _printed(
    scenario: str, method: str, metric: str = "error_r_deg", setting: str = "paper"
) -> float | None:
    return PRINTED.get(Number(place(scenario).table, scenario, method, setting, metric))


def _compared(scenario: str, method: str) -> list[str]:
    """Name the others the paper prints a row for."""
    others = {
        n.method for n in PRINTED if (n.table, n.scenario) == (place(scenario).table, scenario)
    }
    return sorted(others - {method}, key=method_rank)


def _best_of_all(numbers: Numbers, scenario: str) -> Finding:
    others = _compared(scenario, CB)
    printed = {method: _printed(scenario, method) or 0.0 for method in (CB, *others)}
    best = min(others, key=lambda method: printed[method])
    contrasts = [numbers.versus(scenario, CB, other) for other in others]
    return Finding(
        topic=f"Order of methods: {place(scenario).title}",
        claim=(
            f"PCRDiffusion CB errs least of all methods: {printed[CB]}°, the next"
            f" ({shown(best).name}) {printed[best]}° (Table {place(scenario).table})."
        ),
        ours=(*_told(numbers, scenario, CB, contrasts), *_beyond(numbers, scenario, others)),
        verdict=weigh(contrasts, below, above),
    )


def _best_of_family(numbers: Numbers, scenario: str, method: str) -> Finding:
    others = RIVALS[method]
    printed = {name: _printed(scenario, name) or 0.0 for name in (method, *others)}
    best = min(others, key=lambda name: printed[name])
    contrasts = [numbers.versus(scenario, method, other) for other in others]
    return Finding(
        topic=f"Order of {FAMILY[method]} methods: {place(scenario).title}",
        claim=(
            f"{shown(method).name} errs least of the {FAMILY[method]} methods:"
            f" {printed[method]}°, the next ({shown(best).name}) {printed[best]}°"
            f" (Table {place(scenario).table})."
        ),
        ours=_told(numbers, scenario, method, contrasts),
        verdict=weigh(contrasts, below, above),
    )


def _told(
    numbers: Numbers, scenario: str, method: str, contrasts: Sequence[Row | None]
) -> tuple[str, ...]:
    """Say how far ahead or behind a method is: a sentence for each side."""
    mine = numbers.main(scenario, method)
    if mine is None:
        return ()
    found = [row for row in contrasts if row is not None]
    missing = len(contrasts) - len(found)
    sides = {
        "ahead of": [row for row in found if below(row)],
        "behind": [row for row in found if above(row)],
        "not told apart from": [row for row in found if not (below(row) or above(row))],
    }
    return (
        f"Ours: {say(mine)}.",
        *(
            f"It is {side} {len(rows)} of {len(contrasts)} (its error minus theirs): {listed(rows)}."
            for side, rows in sides.items()
            if rows
        ),
        *([f"Of {len(contrasts)} comparisons {missing} were not run."] if missing else []),
    )


def _beyond(numbers: Numbers, scenario: str, compared: Sequence[str]) -> tuple[str, ...]:
    """Say how CB stands against what the paper leaves out, and against the authors' settings."""
    left_out = [
        row
        for method in numbers.methods(scenario)
        if method not in (*compared, CB, CF) and (row := numbers.versus(scenario, CB, method))
    ]
    ahead = [row for row in left_out if above(row)]
    told = f"Of {len(left_out)} methods and floors the paper leaves out, it is behind {len(ahead)}"
    mine = numbers.main(scenario, CB)
    better = [row for row in numbers.official(scenario) if mine and row.value < mine.value]
    return (
        *([f"{told}{': ' if ahead else ''}{listed(ahead)}."] if left_out else []),
        *(
            [f"With their authors' own settings these err less: {', '.join(map(say, better))}."]
            if better
            else []
        ),
    )


def _improves_by_half(numbers: Numbers, method: str) -> Finding:
    rows, sentences = [], []
    for scenario in SCENARIOS:
        found = [row for other in RIVALS[method] if (row := numbers.main(scenario, other))]
        if not found or numbers.main(scenario, method) is None:
            continue
        best = min(found, key=lambda row: row.value).method
        row = numbers.versus(scenario, method, best, IMPROVEMENT)
        if row is not None:
            rows.append(row)
            sentences.append(f"{place(scenario).title}: {said(row)}, against {shown(best).name}.")
    return Finding(
        topic=f"Improvement: {FAMILY[method]}",
        claim=(
            "“In correspondence-free and correspondence-based scenarios, PCRDiffusion can both"
            f" achieve exceeding {HALF_PERCENT:g} % performance improvements” (abstract). We read:"
            f" {shown(method).name}'s error is smaller by more than that than the best"
            f" {FAMILY[method]} baseline's, in one setting at least. {_in_the_paper(method)}"
        ),
        ours=tuple(sentences),
        verdict=weigh_some(
            rows, lambda row: above(row, HALF_PERCENT), lambda row: below(row, HALF_PERCENT)
        ),
    )


def _in_the_paper(method: str) -> str:
    """Say the improvement that follows from the numbers the paper prints for unseen objects."""
    printed = {name: _printed(UNSEEN_OBJECTS, name) or 0.0 for name in (method, *RIVALS[method])}
    best = min(RIVALS[method], key=lambda name: printed[name])
    percent = 100 * (1 - printed[method] / printed[best])
    return f"Its own Table 1a gives {percent:.1f} % over {shown(best).name}."


def _full_overlap(numbers: Numbers) -> Finding:
    here = [name for name in FULL_OVERLAP if numbers.main(name, CB)]
    contrasts = [numbers.versus(name, CB, "icp_centroid") for name in here]
    errors = [_printed(name, "icp") or 0.0 for name in FULL_OVERLAP]
    theirs = [_printed(name, CB) or 0.0 for name in FULL_OVERLAP]
    sentences = [
        f"{place(name).title}: started from the centroids, {say(floor, 'ICP')};"
        f" CB minus that {said(contrast)}."
        for name, contrast in zip(here, contrasts, strict=True)
        if contrast and (floor := numbers.main(name, "icp_centroid"))
    ]
    return Finding(
        topic="Difficulty of the settings with full overlap",
        claim=(
            f"Where both clouds show the whole shape, ICP errs by {min(errors):.1f}° to"
            f" {max(errors):.1f}° and CB by {min(theirs):.1f}° to {max(theirs):.1f}° (Tables 1a to"
            " 1c and 2); the paper's ICP does not start from the centroids."
        ),
        ours=tuple(sentences),
        verdict=weigh(contrasts, below, above),
    )


def _ablated(
    numbers: Numbers, table: str, method: str, settings: tuple[str, str]
) -> tuple[Row | None, tuple[str, ...], bool]:
    """Give the contrast of two settings, the sentences that say it, and whether either learnt.

    What does not beat the mean training pose has learnt nothing that could differ.
    """
    mine, base = settings
    contrast = numbers.at(table, UNSEEN_OBJECTS, method, f"{mine} minus {base}")
    ours = [numbers.at(table, UNSEEN_OBJECTS, method, setting) for setting in settings]
    told = [f"{setting}: {said(row)}." for setting, row in zip(settings, ours, strict=True) if row]
    constant = numbers.main(UNSEEN_OBJECTS, "constant")
    learnt = constant is None or any(row and below(row, constant.value) for row in ours)
    idle = f"Neither is below the constant pose, {said(constant)}." if constant else ""
    return (
        contrast,
        (
            *([f"{mine} minus {base}: {said(contrast)}."] if contrast else []),
            *told,
            *([] if learnt else [idle]),
        ),
        learnt,
    )


def _weighed(verdict: Verdict, learnt: bool) -> Verdict:
    """Withhold a verdict on two settings of which neither has learnt anything."""
    return verdict if learnt or verdict == "not run" else "undecided"


def _theirs(table: str, method: str, setting: str, metric: str = MAE_AND_ERROR[2]) -> float:
    return PRINTED[Number(table, UNSEEN_OBJECTS, method, setting, metric)]


def _diffusion(numbers: Numbers, method: str) -> Finding:
    contrast, told, learnt = _ablated(numbers, "3", method, ("diffusion=with", "diffusion=without"))
    return Finding(
        topic=f"Gain by diffusion: {shown(method).name[-2:]}",
        claim=(
            f"Without diffusion the error of {shown(method).name} rises from"
            f" {_theirs('3', method, 'diffusion=with')}° to"
            f" {_theirs('3', method, 'diffusion=without')}° (Table 3)."
        ),
        ours=told,
        verdict=_weighed(weigh([contrast], below, above), learnt),
    )


def _euler(numbers: Numbers) -> Finding:
    raw = "representation={},scaling=raw"
    base = raw.format("quaternion")
    settings = (raw.format("euler"), base)
    contrast, told, learnt = _ablated(numbers, "4", CB, settings)
    others = [
        f"{setting} minus {base}: {said(row)}."
        for setting in sorted(
            numbers.settings("4", UNSEEN_OBJECTS, CB, "representation="), key=setting_rank
        )
        if setting not in settings
        and (row := numbers.at("4", UNSEEN_OBJECTS, CB, f"{setting} minus {base}"))
    ]
    return Finding(
        topic="Representation",
        claim=(
            "Diffusing a quaternion and a translation is better than Euler angles and a"
            f" translation: {_theirs('4', CB, base)}° against {_theirs('4', CB, settings[0])}°"
            " (Table 4)."
        ),
        ours=(*told, *others),
        verdict=_weighed(weigh([contrast], above, below), learnt),
    )


def _concat(numbers: Numbers) -> Finding:
    setting = "fusion=concat minus constant:paper"
    contrast = numbers.at("5", UNSEEN_OBJECTS, CF, setting)
    _, told, _ = _ablated(numbers, "5", CF, ("fusion=concat", "fusion=source"))
    against = f"fusion=concat minus the constant pose: {said(contrast)}." if contrast else ""
    return Finding(
        topic="Fusion: concatenation",
        claim=(
            "Concatenating the features of the noisy pose and of both clouds does not converge"
            " (Table 5, no numbers). We read: it does not beat the mean training pose."
        ),
        ours=(*([against] if against else []), *told),
        verdict=weigh([contrast], above, below),
    )


def _fused_with_target(numbers: Numbers) -> Finding:
    contrast, told, learnt = _ablated(numbers, "5", CF, ("fusion=target", "fusion=source"))
    return Finding(
        topic="Fusion: source or target",
        claim=(
            "Whether the noisy pose is fused with the source or the target makes no significant"
            f" difference: {_theirs('5', CF, 'fusion=source')}° and"
            f" {_theirs('5', CF, 'fusion=target')}° (Table 5)."
        ),
        ours=told,
        verdict=_weighed(weigh_same([contrast]), learnt),
    )


def _steps(numbers: Numbers, rows: Sequence[Row]) -> list[Finding]:
    settings = numbers.settings("7", UNSEEN_OBJECTS, CF, "steps=")
    more = sorted((name for name in settings if "ddpm" in name and name != ONE_STEP), key=natural)
    found = [
        row
        for name in more
        if (row := numbers.at("7", UNSEEN_OBJECTS, CF, f"{name} minus {ONE_STEP}"))
    ]
    told = tuple(f"{row.setting}: {said(row)}." for row in found)
    one, two = (_theirs("7", CF, f"steps={n},sampler=ddpm") for n in (1, 2))
    weighed: list[tuple[str, str, Verdict]] = [
        (
            "one is best",
            f"“PCRDiffusion yields optimal outcomes within a single step”; its Table 7 has {one}°"
            f" at one step and {two}° at two, four and eight. We read: more steps err more.",
            weigh(found, above, below),
        ),
        (
            "convergence",
            f"With more steps the error converges at once: {two}° from two steps on, against"
            f" {one}° at one (Table 7). We read: the number of steps makes no difference.",
            weigh_same(found),
        ),
        (
            "more for accuracy",
            "“We can adjust the number of denoising sampling steps to improve the registration"
            " accuracy.” We read: some number of steps above one errs less than one.",
            weigh_some(found, below, above),
        ),
    ]
    return [
        *(Finding(f"Steps: {topic}", claim, told, verdict) for topic, claim, verdict in weighed),
        _start(rows),
    ]


def _start(rows: Sequence[Row]) -> Finding:
    """Weigh whether the answer depends on the random pose that the walk starts from."""
    spreads = [
        spread(draws)
        for method in (CF, CB)
        for setting in (ONE_STEP, "steps=16,sampler=ddpm")
        if len(draws := _draws(rows, method, setting)) > 1
    ]
    return Finding(
        topic="Steps: what the random start carries",
        claim=(
            "The model refines a randomly generated pose into the answer (abstract, Algorithm 2)."
            " At t = T the cosine schedule leaves the pose a signal-to-noise ratio of 2e-9: what"
            " starts the walk is noise alone. We read: another draw of it moves the mean error by"
            f" more than {NO_DIFFERENCE_DEG}°."
        ),
        ours=tuple(
            f"{shown(row.method).name}, {row.setting}: the mean error's standard deviation over"
            f" draws is {said(row)}."
            for row in spreads
        ),
        verdict=weigh(
            spreads,
            lambda row: above(row, NO_DIFFERENCE_DEG),
            lambda row: below(row, NO_DIFFERENCE_DEG),
        ),
    )


def _draws(rows: Sequence[Row], method: str, setting: str) -> list[Row]:
    return [
        row
        for row in rows
        if (row.table, row.method, row.metric, row.subset) == ("7", method, "error_r_deg", "all")
        and row.kind in ("line", "draw")
        and row.setting.partition(",draw=")[0] == setting
    ]


def _fastest(numbers: Numbers, method: str) -> Finding:
    others = [*RIVALS[method]]
    timed = {name: _timed(numbers, name) for name in (method, *others)}
    contrasts = [
        numbers.at(
            TIMING.table,
            UNSEEN_OBJECTS,
            method,
            f"paper minus {name}:{row.setting if row else 'paper'}",
            "seconds",
        )
        for name, row in timed.items()
        if name != method
    ]
    mine = timed[method]
    found = [row for row in contrasts if row]
    return Finding(
        topic=f"Speed: {FAMILY[method]}",
        claim=(
            f"{shown(method).name} is the fastest of the {FAMILY[method]} methods"
            f" ({SPEEDS[method]})."
        ),
        ours=(
            *([f"Ours: {say(mine)} a pair."] if mine else []),
            *([f"Its time minus theirs: {listed(found)}."] if found else []),
        ),
        verdict=weigh(contrasts, below, above),
    )


def _timed(numbers: Numbers, method: str) -> Row | None:
    rows = [
        numbers.at(TIMING.table, UNSEEN_OBJECTS, method, setting, "seconds")
        for setting in ("paper", "official")
    ]
    return next((row for row in rows if row), None)


def _noise(numbers: Numbers) -> Finding:
    levels = sorted(numbers.settings("extra", UNSEEN_OBJECTS, CB, "noise="), key=natural)
    contrasts = {
        level: [
            row
            for other in (*RIVALS[CB], *RIVALS[CF])
            if (row := numbers.at(*NOISY, f"{level} minus {other}:{level}"))
        ]
        for level in levels
    }
    sentences = [
        f"{level}: {say(mine)}; its error minus theirs: {listed(contrasts[level])}."
        for level in levels
        if (mine := numbers.at(*NOISY, level)) and contrasts[level]
    ]
    everything = [row for rows in contrasts.values() for row in rows]
    return Finding(
        topic="Noise",
        claim=(
            "Under Gaussian noise of deviation 0.01 CB outperforms the other methods (Table 1c). We"
            " read: at every deviation tried, trained with 0.01, it errs least of those tried."
        ),
        ours=tuple(sentences),
        verdict=weigh(everything, below, above),
    )
