"""The report as one self-contained page: pictures, tables, charts, clouds to turn, provenance."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

import pandas as pd
from plotly.graph_objects import Figure
from plotly.offline import get_plotlyjs

from pipeline.formats.benchmarks import Benchmarks
from pipeline.formats.walks import RecordedWalk
from pipeline.reporting.benchmark_charts import benchmark_charts, latency_rows
from pipeline.reporting.charts import (
    KIND_SYMBOLS,
    MEASURES,
    ablated,
    ablation_chart,
    curves_chart,
    difficulty_chart,
    distribution_chart,
    errors_chart,
    headlines,
    reliability_chart,
    speed_chart,
    starts_chart,
    steps_chart,
)
from pipeline.reporting.claims import Finding
from pipeline.reporting.clouds import Example, describe, scene_data
from pipeline.reporting.documents import environment
from pipeline.reporting.drawing import KINDS
from pipeline.reporting.paper import (
    ABLATIONS,
    ERRORS,
    TIMING,
    UNSEEN_OBJECTS,
    in_order,
    method_rank,
    place,
    scenario_rank,
    shown,
)
from pipeline.reporting.pictures import embedded
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.reading import STARTS, PairFile, Training, Verdicts, choose
from pipeline.reporting.showing import describe_budget, show_bound, show_short
from pipeline.reporting.tables import TRAINED_ON_NOISE, Line, Table, best, unbeaten

ABLATED = ("diffusion", "representation", "fusion", "hypotheses")
"""The ablations with a chart of their settings."""
VERDICTS = {"confirmed": "✓", "not confirmed": "✗", "undecided": "?", "not run": "○"}
"""A symbol beside each verdict, so that nobody needs its colour."""


@dataclass(frozen=True)
class Contents:
    """What the page shows; all of it is read or computed elsewhere."""

    numbers: pd.DataFrame
    answers: pd.DataFrame
    tables: Sequence[Table]
    trust: Mapping[str, Sequence[Line]]
    """By scenario, of the methods that say how sure they are."""
    verdicts: Verdicts
    examples: Sequence[Example]
    pictures: Mapping[str, bytes]
    """By file name; those of single pairs open the page."""
    trainings: Sequence[Training]
    files: Mapping[str, PairFile]
    """By scenario."""
    profile: str
    banner: str | None
    findings: Sequence[Finding] = ()
    walks: Mapping[str, Sequence[RecordedWalk]] = field(default_factory=dict)
    """By scenario."""
    sources: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """By scenario, a sentence for each learned source of starts."""
    provenance: Provenance | None = None
    benchmarks: Benchmarks | None = None
    """What `make bench` measured, on whichever machine; None where it did not."""


def render_page(contents: Contents) -> str:
    """Write the page; the same contents, the same bytes, and nothing to fetch."""
    made = environment(html=True)
    made.globals.update(
        place=place, shown=shown, show_bound=show_bound, show_short=show_short, best=best,
        describe=describe, describe_budget=describe_budget, embedded=embedded,
        latency_rows=latency_rows, KINDS=KINDS, MEASURES=MEASURES, ABLATED=ABLATED,
        ABLATIONS=ABLATIONS, VERDICTS=VERDICTS, UNSEEN_OBJECTS=UNSEEN_OBJECTS,
        BENCHED=TRAINED_ON_NOISE, SIGNS=dict(zip(KIND_SYMBOLS, "■▲●", strict=True)),
    )  # fmt: skip
    scenarios = sorted(contents.files, key=scenario_rank)
    charts = make_charts(contents)
    walks = {name: contents.walks[name] for name in scenarios if contents.walks.get(name)}
    main = {table.scenario: table.headlines for table in contents.tables if table.is_main}
    template = made.get_template("page.html.j2")
    return template.render(
        contents=contents,
        bench=contents.benchmarks,
        scenarios=scenarios,
        methods=in_order(contents.numbers["method"]),
        glance=main,
        glanced=in_order(method for lines in main.values() for method in lines),
        unbeaten=unbeaten(contents.tables),
        pages=[[*some] for _, some in groupby(contents.tables, key=lambda table: table.anchor)],
        walks=walks,
        trainings=_in_order(contents.trainings),
        charts=charts,
        drawn=lambda kind, names: [name for name in names if f"plot-{kind}-{name}" in charts],
        recorded={name: flatten(contents.files[name].provenance) for name in scenarios},
        plotly=get_plotlyjs(),
        chart_data=_script_safe(
            {name: json.loads(chart.to_json(engine="json")) for name, chart in charts.items()}
        ),
        scene_data=_script_safe(scene_data(contents.examples, walks, contents.files)),
    )


def make_charts(contents: Contents) -> dict[str, Figure]:
    """Draw everything there is data for, by the id of its place on the page."""
    numbers, charts = contents.numbers, _error_charts(contents) | _starts_charts(contents.numbers)
    unit = contents.files[UNSEEN_OBJECTS].unit if UNSEEN_OBJECTS in contents.files else ""
    for name in ABLATED:
        if len(ablated(numbers, name)):
            charts[f"plot-ablation-{name}"] = ablation_chart(numbers, name, unit)
    if len(ablated(numbers, "steps")):
        charts["plot-steps"] = steps_chart(numbers, unit)
    if (numbers["table"] == TIMING.table).any():
        charts["plot-speed"] = speed_chart(numbers)
    for metric in MEASURES:
        if binned := difficulty_chart(numbers, metric):
            charts[f"plot-difficulty-{metric}"] = binned
    main = [one for one in _in_order(contents.trainings) if len(one.curve) and not one.setting]
    for scenario in {one.scenario: None for one in main}:
        trained = [one for one in main if one.scenario == scenario]
        charts[f"plot-curves-{scenario}"] = curves_chart(trained)
    return charts | (benchmark_charts(contents.benchmarks) if contents.benchmarks else {})


def _error_charts(contents: Contents) -> dict[str, Figure]:
    charts = {}
    for scenario in headlines(contents.numbers, "error_r_deg")["scenario"].unique():
        unit = contents.files[scenario].unit
        for metric in ERRORS:
            chart = errors_chart(contents.numbers, scenario, metric, unit)
            charts[f"plot-{metric}-{scenario}"] = chart
        chart = distribution_chart(contents.answers, scenario, unit)
        charts[f"plot-distribution-{scenario}"] = chart
    for scenario in contents.trust:
        charts[f"plot-reliability-{scenario}"] = reliability_chart(contents.answers, scenario)
    return charts


def _starts_charts(numbers: pd.DataFrame) -> dict[str, Figure]:
    tried = choose(numbers, ablation=STARTS, metric="below_5_deg_percent")["scenario"].unique()
    return {f"plot-starts-{scenario}": starts_chart(numbers, scenario) for scenario in tried}


def _script_safe(data: Mapping[str, Any]) -> str:
    """Write JSON that cannot end the script element it stands in."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.replace("</", "<\\/").replace("<!--", "<\\u0021--")


def _in_order(trainings: Sequence[Training]) -> list[Training]:
    def rank(one: Training) -> tuple[object, ...]:
        ranks = scenario_rank(one.scenario), method_rank(one.method)
        return one.setting != "", *ranks, one.setting

    return sorted(trainings, key=rank)


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
