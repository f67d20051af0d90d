"""The report as one self-contained page: findings, tables, charts, clouds to turn, provenance."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from pipeline.formats.benchmarks import Benchmarks
from pipeline.formats.walks import Walk
from pipeline.reporting.background import PairFacts, Training
from pipeline.reporting.benchmark_figures import benchmark_figures, in_order, latency_name
from pipeline.reporting.figures import (
    KINDS,
    Figure,
    curves_figure,
    distribution_figure,
    errors_figure,
)
from pipeline.reporting.findings import ELSEWHERE, RULE, Finding
from pipeline.reporting.overlays import KnownPair, Overlay
from pipeline.reporting.paper import (
    ABLATIONS,
    FLOORS,
    UNSEEN_OBJECTS,
    method_rank,
    place,
    scenario_rank,
    shown,
)
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.result_files import Scores
from pipeline.reporting.scenes import overlay_figure, scene_data, walk_figure
from pipeline.reporting.study_figures import (
    ABLATED,
    MEASURES,
    ablation_figure,
    ablation_rows,
    difficulty_figure,
    speed_figure,
    steps_figure,
)
from pipeline.reporting.tables import RESAMPLES, Row
from pipeline.reporting.views import (
    HEADINGS,
    MARKS,
    NOISY,
    NOT_BELOW_ICP,
    Line,
    Table,
    describe_budget,
    main_rows,
    show,
    show_bound,
    show_metric,
    unit_of,
)

VERDICTS = {"confirmed": "✓", "not confirmed": "✗", "undecided": "?", "not run": "○"}
"""A symbol beside each verdict, so that nobody needs its colour."""
ERRORS = {"rotation": "error_r_deg", "translation": "error_t"}


@dataclass(frozen=True)
class Contents:
    """What the page shows; all of it is read or computed elsewhere."""

    rows: Sequence[Row]
    tables: Sequence[Table]
    overlays: Sequence[Overlay]
    trainings: Sequence[Training]
    facts: Mapping[str, PairFacts]
    profile: str
    banner: str | None
    findings: Sequence[Finding] = ()
    walks: Mapping[str, Sequence[Walk]] = field(default_factory=dict)
    """By scenario."""
    walked: Mapping[str, Mapping[int, KnownPair]] = field(default_factory=dict)
    """The pairs of those walks, by scenario and index; a scenario without them is left out."""
    scores: Sequence[Scores] = ()
    provenance: Provenance | None = None
    benchmarks: Benchmarks | None = None
    """What `make bench` measured, on whichever machine; None where it did not."""


def render_page(contents: Contents) -> str:
    """Write the page; the same contents, the same bytes, and nothing to fetch."""
    environment = Environment(
        loader=PackageLoader("pipeline.reporting"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals.update(
        place=place,
        shown=shown,
        show=show,
        show_bound=show_bound,
        show_metric=show_metric,
        unit_of=unit_of,
        describe_budget=describe_budget,
        HEADINGS=HEADINGS,
        MARKS=MARKS,
        VERDICTS=VERDICTS,
        KINDS=KINDS,
        MEASURES=MEASURES,
        ABLATED=ABLATED,
        ABLATIONS=ABLATIONS,
        UNSEEN_OBJECTS=UNSEEN_OBJECTS,
        best=best,
        BENCHED=NOISY,
        in_order=in_order,
        latency_name=latency_name,
        RESAMPLES=RESAMPLES,
        RULE=RULE.replace("**", ""),
        ELSEWHERE=ELSEWHERE.replace("`", ""),
    )
    scenarios = sorted(contents.facts, key=scenario_rank)
    curves = _by_scenario(contents.trainings)
    figures = _figures(contents, curves)
    walks = {name: contents.walks[name] for name in scenarios if name in _walked(contents)}
    return environment.get_template("report.html.j2").render(
        contents=contents,
        bench=contents.benchmarks,
        scenarios=scenarios,
        methods=sorted({row.method for row in contents.rows}, key=method_rank),
        glance=_glance(contents.tables),
        unbeaten=unbeaten(contents.tables),
        pages=_paired(contents.tables),
        curves=curves,
        walks=walks,
        trainings=_in_order(contents.trainings),
        figures=figures,
        drawn=partial(_drawn, figures),
        recorded={name: flatten(contents.facts[name].provenance) for name in scenarios},
        plotly=get_plotlyjs(),
        figure_data=_script_safe(figures),
        scene_data=_script_safe(scene_data(contents.overlays, walks, contents.walked)),
    )


def _drawn(figures: Mapping[str, Figure], prefix: str, names: Iterable[str]) -> list[str]:
    """List what has a figure of this kind."""
    return [name for name in names if f"{prefix}{name}" in figures]


def _script_safe(data: Mapping[str, Any]) -> str:
    """Write JSON that cannot end the script element it stands in."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.replace("</", "<\\/").replace("<!--", "<\\u0021--")


def _figures(contents: Contents, curves: Mapping[str, Sequence[Training]]) -> dict[str, Figure]:
    """Draw everything there is data for, by the id of its place on the page."""
    figures = _error_figures(contents) | _study_figures(contents)
    if contents.benchmarks is not None:
        figures |= benchmark_figures(contents.benchmarks)
    for overlay in contents.overlays:
        figures[f"plot-overlay-{overlay.facts.scenario}"] = overlay_figure(overlay)
    for scenario in _walked(contents):
        figures[f"plot-walk-{scenario}"] = walk_figure(contents.facts[scenario].unit)
    for scenario, trainings in curves.items():
        figures[f"plot-curves-{scenario}"] = curves_figure(trainings)
    return figures


def _error_figures(contents: Contents) -> dict[str, Figure]:
    figures = {}
    for kind, metric in ERRORS.items():
        for scenario in {scenario for scenario, _ in main_rows(contents.rows, metric)}:
            unit = unit_of(metric, contents.facts[scenario].unit)
            label = f"{HEADINGS[metric]} [{unit}]"
            figure = errors_figure(contents.rows, scenario, metric, label)
            figures[f"plot-errors-{kind}-{scenario}"] = figure
    for scenario in {one.scenario for one in contents.scores if one.ablation is None}:
        unit = contents.facts[scenario].unit
        figures[f"plot-distribution-{scenario}"] = distribution_figure(
            contents.scores, scenario, unit
        )
    return figures


def _study_figures(contents: Contents) -> dict[str, Figure]:
    rows, figures = contents.rows, {}
    here = [row for row in rows if row.scenario == UNSEEN_OBJECTS]
    unit = contents.facts[UNSEEN_OBJECTS].unit if here else ""
    floors = [
        row
        for metric in ("error_r_deg", "error_t")
        for row in main_rows(here, metric).values()
        if row.method in FLOORS
    ]
    for table in ABLATED:
        if chosen := ablation_rows(here, table):
            figures[f"plot-ablation-{table}"] = ablation_figure(chosen, unit, floors)
    if steps := [row for row in here if row.table == "7"]:
        figures["plot-steps"] = steps_figure(steps, unit)
    timed = [row for row in here if row.table == "6"]
    if any(row.metric == "seconds" for row in timed):
        figures["plot-speed"] = speed_figure(timed)
    for metric in MEASURES:
        if binned := difficulty_figure(rows, metric):
            figures[f"plot-difficulty-{metric}"] = binned
    return figures


def _walked(contents: Contents) -> list[str]:
    """Name the scenarios whose walks can be shown: those with the pairs' clouds."""
    return [name for name in contents.walks if contents.walks[name] and name in contents.walked]


def _by_scenario(trainings: Sequence[Training]) -> dict[str, list[Training]]:
    """Group the curves of the main trainings; an ablation's would hide them."""
    found: dict[str, list[Training]] = {}
    for one in _in_order(trainings):
        if one.curve and one.setting is None:
            found.setdefault(one.scenario, []).append(one)
    return found


def _in_order(trainings: Sequence[Training]) -> list[Training]:
    return sorted(
        trainings,
        key=lambda one: (
            one.setting is not None,
            scenario_rank(one.scenario),
            method_rank(one.method),
            one.setting or "",
        ),
    )


def _glance(tables: Sequence[Table]) -> dict[str, dict[str, Line]]:
    """Pick the headline line of each method (outer key) in each scenario (inner key)."""
    found: dict[str, dict[str, Line]] = {}
    for table in tables:
        number, scenario, ablated, subset = table.key
        if number == place(scenario).table and (ablated, subset) == ("", "all"):
            for line in sorted(table.lines, key=lambda line: line.setting != "paper"):
                found.setdefault(line.method, {}).setdefault(scenario, line)
    return {method: found[method] for method in sorted(found, key=method_rank)}


def _paired(tables: Sequence[Table]) -> list[list[Table]]:
    """Put a table and its subsets together."""
    found: dict[tuple[str, str, str], list[Table]] = {}
    for table in tables:
        found.setdefault(table.key[:3], []).append(table)
    return list(found.values())


def unbeaten(tables: Sequence[Table]) -> list[str]:
    """Name the scenarios in which no method beats ICP from the centroids."""
    return [
        place(table.key[1]).title
        for table in tables
        if (table.key[0], *table.key[2:]) == (place(table.key[1]).table, "", "all")
        and all(NOT_BELOW_ICP in line.marks for line in table.lines if not line.is_floor)
    ]


def best(table: Table) -> dict[str, float]:
    """Find the best value of each metric among the methods that are not floors."""
    values: dict[str, list[float]] = {}
    for line in table.lines:
        if not line.is_floor:
            for metric, row in line.cells.items():
                values.setdefault(metric, []).append(row.value)
    return {m: max(v) if m.endswith("_percent") else min(v) for m, v in values.items()}


def flatten(provenance: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """List what a provenance says, leaf by leaf, without paths of the machine it was made on."""
    leaves: dict[str, str] = {}
    for key, value in sorted(provenance.items()):
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            leaves |= flatten(value, f"{name}.")
        elif isinstance(value, list) and len(json.dumps(value)) > 120:
            leaves[name] = f"{len(value)} entries"
        elif not _is_path(value):
            leaves[name] = value if isinstance(value, str) else json.dumps(value)
    return leaves


def _is_path(value: object) -> bool:
    return isinstance(value, str) and (
        PurePosixPath(value).is_absolute() or PureWindowsPath(value).is_absolute()
    )
