"""The claims of the paper, and what the results say of each: the part "What we found".

The rule of the verdicts is ``verdicts.RULE``; it is printed above the findings.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import pandas as pd

from pipeline.reporting.numbers import IMPROVEMENT, SPREAD
from pipeline.reporting.paper import (
    ABLATIONS,
    CONCAT,
    PRINTED,
    RIVALS,
    SCENARIOS,
    TIMING,
    UNSEEN_OBJECTS,
    in_order,
    method_rank,
    named,
    place,
    printed,
    scenario_rank,
    shown,
    source_of,
    varied,
)
from pipeline.reporting.reading import STARTS, choose
from pipeline.reporting.verdicts import (
    NO_DIFFERENCE_DEG,
    Number,
    Numbers,
    Rule,
    Verdict,
    above,
    below,
    less,
    listed,
    more,
    said,
    say,
    weigh_same,
    weigh_some,
)

CF, CB = "pcrdiffusion_cf", "pcrdiffusion_cb"
FAMILY = {CF: "correspondence-free", CB: "correspondence-based"}
HALF_PERCENT = 50.0
ONE_STEP, SIXTEEN_STEPS = "steps=1,sampler=ddpm", "steps=16,sampler=ddpm"
SPEEDS = {
    CF: "Table 6: below 1e-10 s, less than one operation of a processor takes",
    CB: "Table 6: 0.0986 s; but it prints 0.0042 s for ICP and 0.0916 s for FGR",
}
UNWEIGHED = ("quick", "tables")
"""Profiles that train too little for a verdict."""
ELSEWHERE = (
    "The paper's claims are weighed in the report on real data, `reports/real/results.md`; this one"
    " gives no verdicts."
)
"""Stands in a report without findings."""
RANDOM_STARTS = "gicp_multistart"
"""The source that learned ones are held against."""
SAMPLES = (1, 4)
"""How many of a learned source are held against random starts."""
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


def make_findings(numbers: pd.DataFrame) -> list[Finding]:
    """Weigh every claim of the paper against the numbers, spreads among them."""
    found = Numbers(numbers)
    tried = {method: [name for name in SCENARIOS if _theirs(name, method)] for method in (CF, CB)}
    return [
        *(_order(found, name, CB, _compared(name), "") for name in tried[CB]),
        *(_order(found, name, CF, RIVALS[CF], f"{FAMILY[CF]} ") for name in tried[CF]),
        *(_improves_by_half(found, method) for method in (CF, CB)),
        _full_overlap(found),
        *_ablations(found),
        *_steps(found),
        _start(found),
        *(_fastest(found, method) for method in (CF, CB)),
        _noise(found),
    ]


def _theirs(scenario: str, method: str) -> float:
    """Give the paper's ERROR(R) in Tables 1 and 2, 0 where it prints none."""
    return printed(place(scenario).table, scenario, method) or 0.0


def _compared(scenario: str) -> list[str]:
    """Name the methods beside CB that the paper prints a row for."""
    here = choose(PRINTED, table=place(scenario).table, scenario=scenario)
    return in_order({*here["method"]} - {CB})


def _order(
    numbers: Numbers, scenario: str, method: str, others: Sequence[str], family: str
) -> Finding:
    """Weigh that a method errs least of all, or of its family (a word and a space)."""
    best = min(others, key=lambda name: _theirs(scenario, name))
    contrasts = [numbers.versus(scenario, method, other) for other in others]
    beyond = [] if family else _beyond(numbers, scenario, others)
    return Finding(
        topic=f"Order of {family}methods: {place(scenario).title}",
        claim=(
            f"{shown(method).name} errs least of {'the' if family else 'all'} {family}methods:"
            f" {_theirs(scenario, method)}°, the next ({shown(best).name})"
            f" {_theirs(scenario, best)}° (Table {place(scenario).table})."
        ),
        ours=(*_told(numbers, scenario, method, contrasts), *beyond),
        verdict=less(contrasts),
    )


def _told(
    numbers: Numbers, scenario: str, method: str, contrasts: Sequence[Number | None]
) -> list[str]:
    """Say how far ahead or behind a method is: a sentence for each side."""
    mine, count = numbers.main(scenario, method), len(contrasts)
    if mine is None:
        return []
    found = [row for row in contrasts if row is not None]
    sides = {
        "ahead of": [row for row in found if below(row)],
        "behind": [row for row in found if above(row)],
        "not told apart from": [row for row in found if not (below(row) or above(row))],
    }
    told = [
        f"It is {side} {len(rows)} of {count} (its error minus theirs): {listed(rows)}."
        for side, rows in sides.items()
        if rows
    ]
    if len(found) < count:
        told.append(f"Of {count} comparisons {count - len(found)} were not run.")
    return [f"Ours: {say(mine)}.", *told]


def _beyond(numbers: Numbers, scenario: str, compared: Sequence[str]) -> list[str]:
    """Say how CB stands against what the paper leaves out, and against the authors' settings."""
    left_out = [
        row
        for method in numbers.methods(scenario)
        if method not in (*compared, CB, CF) and (row := numbers.versus(scenario, CB, method))
    ]
    ahead = [row for row in left_out if above(row)]
    mine, told = numbers.main(scenario, CB), []
    if left_out:
        behind = f"{len(ahead)}{': ' if ahead else ''}{listed(ahead)}"
        told.append(
            f"Of {len(left_out)} methods and floors the paper leaves out, it is behind {behind}."
        )
    official = (
        numbers.at(place(scenario).table, scenario, method, "official")
        for method in numbers.methods(scenario)
    )
    if better := [row for row in official if row and mine and row.value < mine.value]:
        names = ", ".join(map(say, better))
        told.append(f"With their authors' own settings these err less: {names}.")
    return told


def _improves_by_half(numbers: Numbers, method: str) -> Finding:
    rows, sentences = [], []
    for scenario in SCENARIOS:
        found = [row for other in RIVALS[method] if (row := numbers.main(scenario, other))]
        best = min(found, key=lambda row: row.value).method if found else ""
        if row := numbers.versus(scenario, method, best, IMPROVEMENT):
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
        verdict=weigh_some(rows, above, below, HALF_PERCENT),
    )


def _in_the_paper(method: str) -> str:
    """Say the improvement that follows from the numbers the paper prints for unseen objects."""
    best = min(RIVALS[method], key=lambda name: _theirs(UNSEEN_OBJECTS, name))
    percent = 100 * (1 - _theirs(UNSEEN_OBJECTS, method) / _theirs(UNSEEN_OBJECTS, best))
    return f"Its own Table 1a gives {percent:.1f} % over {shown(best).name}."


def _full_overlap(numbers: Numbers) -> Finding:
    here = [name for name in FULL_OVERLAP if numbers.main(name, CB)]
    contrasts = [numbers.versus(name, CB, "icp_centroid") for name in here]
    icp, cb = ([_theirs(name, method) for name in FULL_OVERLAP] for method in ("icp", CB))
    sentences = [
        f"{place(name).title}: started from the centroids, {say(floor, 'ICP')};"
        f" CB minus that {said(contrast)}."
        for name, contrast in zip(here, contrasts, strict=True)
        if contrast and (floor := numbers.main(name, "icp_centroid"))
    ]
    return Finding(
        topic="Difficulty of the settings with full overlap",
        claim=(
            f"Where both clouds show the whole shape, ICP errs by {min(icp):.1f}° to"
            f" {max(icp):.1f}° and CB by {min(cb):.1f}° to {max(cb):.1f}° (Tables 1a to"
            " 1c and 2); the paper's ICP does not start from the centroids."
        ),
        ours=tuple(sentences),
        verdict=less(contrasts),
    )


def _ablations(numbers: Numbers) -> list[Finding]:
    return [
        *(
            _two_settings(
                numbers, method, ("diffusion=with", "diffusion=without"),
                f"Gain by diffusion: {shown(method).name[-2:]}",
                f"Without diffusion the error of {shown(method).name} rises from {{mine}}° to"
                " {base}° (Table 3).",
                less,
            )
            for method in (CF, CB)
        ),
        _euler(numbers),
        _concat(numbers),
        _two_settings(
            numbers, CF, ("fusion=target", "fusion=source"), "Fusion: source or target",
            "Whether the noisy pose is fused with the source or the target makes no significant"
            " difference: {base}° and {mine}° (Table 5).",
            weigh_same,
        ),
    ]  # fmt: skip


def _two_settings(
    numbers: Numbers, method: str, settings: tuple[str, str], topic: str, claim: str, rule: Rule
) -> Finding:
    """Weigh a setting against the base of its ablation; ``claim`` has places for their errors.

    What does not beat the mean training pose has learnt nothing that could differ.
    """
    (mine, base), ablation = settings, settings[0].partition("=")[0]
    contrast = numbers.ablated(ablation, method, mine, base)
    ours = [row for name in settings if (row := numbers.ablated(ablation, method, name))]
    constant = numbers.main(UNSEEN_OBJECTS, "constant")
    learnt = not constant or any(below(row, constant.value) for row in ours)
    told = [f"{mine} minus {base}: {said(contrast)}."] if contrast else []
    told += [f"{row.setting}: {said(row)}." for row in ours]
    if constant and not learnt:
        told.append(f"Neither is below the constant pose, {said(constant)}.")
    table, verdict = ABLATIONS[ablation].table, rule([contrast])
    theirs = [printed(table, UNSEEN_OBJECTS, method, name) for name in settings]
    undecided = not learnt and verdict != "not run"
    claim = claim.format(mine=theirs[0], base=theirs[1])
    return Finding(topic, claim, tuple(told), "undecided" if undecided else verdict)


def _euler(numbers: Numbers) -> Finding:
    base, euler = (f"representation={name},scaling=raw" for name in ("quaternion", "euler"))
    found = _two_settings(
        numbers, CB, (euler, base), "Representation",
        "Diffusing a quaternion and a translation is better than Euler angles and a translation:"
        " {base}° against {mine}° (Table 4).",
        more,
    )  # fmt: skip
    others = [
        f"{setting} minus {base}: {said(row)}."
        for setting in numbers.settings("representation", CB)
        if setting != euler and (row := numbers.ablated("representation", CB, setting, base))
    ]
    return replace(found, ours=(*found.ours, *others))


def _concat(numbers: Numbers) -> Finding:
    found = _two_settings(
        numbers, CF, (CONCAT, "fusion=source"), "Fusion: concatenation",
        "Concatenating the features of the noisy pose and of both clouds does not converge"
        " (Table 5, no numbers). We read: it does not beat the mean training pose.",
        more,
    )  # fmt: skip
    contrast = numbers.ablated("fusion", CF, CONCAT, ("constant", "paper"))
    against = [f"{CONCAT} minus the constant pose: {said(contrast)}."] if contrast else []
    return replace(found, ours=(*against, *found.ours), verdict=more([contrast]))


def _steps(numbers: Numbers) -> list[Finding]:
    several = [name for name in numbers.settings("steps", CF) if "ddpm" in name]
    found = [row for name in several if (row := numbers.ablated("steps", CF, name, ONE_STEP))]
    told = tuple(f"{row.setting} minus {ONE_STEP}: {said(row)}." for row in found)
    at, table = "steps={},sampler=ddpm", ABLATIONS["steps"].table
    one, two = (printed(table, UNSEEN_OBJECTS, CF, at.format(steps)) for steps in (1, 2))
    best = (
        f"“PCRDiffusion yields optimal outcomes within a single step”; its Table 7 has {one}°"
        f" at one step and {two}° at two, four and eight. We read: more steps err more."
    )
    convergence = (
        f"With more steps the error converges at once: {two}° from two steps on, against"
        f" {one}° at one (Table 7). We read: the number of steps makes no difference."
    )
    accuracy = (
        "“We can adjust the number of denoising sampling steps to improve the registration"
        " accuracy.” We read: some number of steps above one errs less than one."
    )
    return [
        Finding("Steps: one is best", best, told, more(found)),
        Finding("Steps: convergence", convergence, told, weigh_same(found)),
        Finding("Steps: more for accuracy", accuracy, told, weigh_some(found, below, above)),
    ]


def _start(numbers: Numbers) -> Finding:
    """Weigh whether the answer depends on the random pose that the walk starts from."""
    spreads = [
        row
        for method in (CF, CB)
        for setting in (ONE_STEP, SIXTEEN_STEPS)
        if (row := numbers.ablated("steps", method, setting, metric=SPREAD))
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
        verdict=more(spreads, NO_DIFFERENCE_DEG),
    )


def _fastest(numbers: Numbers, method: str) -> Finding:
    def seconds(name: str, setting: str, base: tuple[str, str] = ("", "")) -> Number | None:
        return numbers.at(TIMING.table, UNSEEN_OBJECTS, name, setting, "seconds", base)

    mine = seconds(method, "paper") or seconds(method, "official")
    contrasts = [
        seconds(method, "paper", (name, "paper")) or seconds(method, "paper", (name, "official"))
        for name in RIVALS[method]
    ]
    told, family = [f"Ours: {say(mine)} a pair."] if mine else [], FAMILY[method]
    if found := [row for row in contrasts if row]:
        told.append(f"Its time minus theirs: {listed(found)}.")
    return Finding(
        topic=f"Speed: {family}",
        claim=f"{shown(method).name} is the fastest of the {family} methods ({SPEEDS[method]}).",
        ours=tuple(told),
        verdict=less(contrasts),
    )


def _noise(numbers: Numbers) -> Finding:
    contrasts = {
        level: [
            row
            for other in (*RIVALS[CB], *RIVALS[CF])
            if (row := numbers.ablated("noise", CB, level, (other, level)))
        ]
        for level in numbers.settings("noise", CB)
    }
    sentences = [
        f"{level}: {say(mine)}; its error minus theirs: {listed(rows)}."
        for level, rows in contrasts.items()
        if rows and (mine := numbers.ablated("noise", CB, level))
    ]
    return Finding(
        topic="Noise",
        claim=(
            "Under Gaussian noise of deviation 0.01 CB outperforms the other methods (Table 1c). We"
            " read: at every deviation tried, trained with 0.01, it errs least of those tried."
        ),
        ours=tuple(sentences),
        verdict=less([row for rows in contrasts.values() for row in rows]),
    )


def weigh_sources(numbers: pd.DataFrame) -> dict[str, list[str]]:
    """Say, by scenario, how many random starts find as many pairs as samples of a learned source.

    A sentence for each learned source; a scenario without random or learned starts has none. What
    is compared are the shares themselves, not their intervals.
    """
    rows = choose(numbers, kind="line", subset="all", ablation=STARTS, metric="below_5_deg_percent")
    told = {name: [*_sources(found)] for name, found in rows.groupby("scenario")}
    return {name: told[name] for name in sorted(told, key=scenario_rank) if told[name]}


def _sources(rows: pd.DataFrame) -> Iterator[str]:
    sources: dict[tuple[str, str], dict[int, Number]] = {}
    for row in map(Number._make, rows[[*Number._fields]].itertuples(index=False, name=None)):
        source = sources.setdefault((row.method, source_of(row.setting)), {})
        source[int(varied(row.setting)["starts"])] = row
    random = sources.pop((RANDOM_STARTS, ""), {})
    for method, setting in sorted(sources, key=lambda key: (method_rank(key[0]), key[1])):
        found = sources[method, setting]
        parts = [_worth(k, found[k], random) for k in SAMPLES if random and k in found]
        if parts and shown(method).kind == "learned":
            yield f"{named(method, setting)}: {'; '.join(parts)}."


def _worth(samples: int, row: Number, random: Mapping[int, Number]) -> str:
    """Say how many pairs some samples find, and how many random starts find no fewer."""
    enough = [count for count, other in random.items() if other.value >= row.value]
    count = min(enough, default=max(random))
    starts = f"{'' if enough else 'more than '}{count} random start{'s' * (count != 1)}"
    finds = "sample finds" if samples == 1 else "samples find"
    return (
        f"{samples} {finds} {said(row)} of the pairs, which takes {starts} ({said(random[count])})"
    )
