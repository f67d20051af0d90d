"""The report as one self-contained page: tables, charts, clouds to turn, provenance."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from pipeline.background import PairFacts, Training
from pipeline.figures import Figure, curves_figure, errors_figure, overlay_figure, steps_figure
from pipeline.overlays import Overlay, describe
from pipeline.paper import UNSEEN_OBJECTS, method_rank, place, scenario_rank, shown
from pipeline.tables import RESAMPLES, Row
from pipeline.views import (
    HEADINGS,
    MARKS,
    NOT_BELOW_ICP,
    Line,
    Table,
    describe_budget,
    show,
    show_bound,
    show_metric,
    unit_of,
)

PACKAGES = ("h5py", "matplotlib", "numpy", "open3d", "plotly", "scipy", "torch")


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


def render_page(contents: Contents) -> str:
    """Write the page; the same contents, the same bytes, and nothing to fetch."""
    environment = Environment(
        loader=PackageLoader("pipeline"),
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
        describe=describe,
        describe_budget=describe_budget,
        HEADINGS=HEADINGS,
        MARKS=MARKS,
        best=best,
        RESAMPLES=RESAMPLES,
    )
    scenarios = sorted(contents.facts, key=scenario_rank)
    curves = _by_scenario(contents.trainings)
    figures = _figures(contents, curves)
    return environment.get_template("report.html.j2").render(
        contents=contents,
        scenarios=scenarios,
        glance=_glance(contents.tables),
        unbeaten=unbeaten(contents.tables),
        pages=_paired(contents.tables),
        curves=curves,
        trainings=_in_order(contents.trainings),
        has_steps="plot-steps" in figures,
        provenance={name: flatten(contents.facts[name].provenance) for name in scenarios},
        packages={name: version(name) for name in PACKAGES},
        plotly=get_plotlyjs(),
        figures=json.dumps(figures, sort_keys=True, separators=(",", ":")).replace("</", "<\\/"),
    )


def _figures(contents: Contents, curves: Mapping[str, Sequence[Training]]) -> dict[str, Figure]:
    rows = contents.rows
    figures = {
        "plot-errors-rotation": errors_figure(rows, "error_r_deg", "ERROR(R) [deg]"),
        "plot-errors-translation": errors_figure(rows, "error_t", "ERROR(t) [unit of the data]"),
    }
    for overlay in contents.overlays:
        figures[f"plot-overlay-{overlay.facts.scenario}"] = overlay_figure(overlay)
    for scenario, trainings in curves.items():
        figures[f"plot-curves-{scenario}"] = curves_figure(trainings)
    steps = [row for row in rows if (row.table, row.scenario) == ("7", UNSEEN_OBJECTS)]
    if steps:
        figures["plot-steps"] = steps_figure(steps, contents.facts[UNSEEN_OBJECTS].unit)
    return figures


def _by_scenario(trainings: Sequence[Training]) -> dict[str, list[Training]]:
    found: dict[str, list[Training]] = {}
    for one in _in_order(trainings):
        if one.curve:
            found.setdefault(one.scenario, []).append(one)
    return found


def _in_order(trainings: Sequence[Training]) -> list[Training]:
    return sorted(trainings, key=lambda one: (scenario_rank(one.scenario), method_rank(one.method)))


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
        if table.key[2:] == ("", "all")
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
