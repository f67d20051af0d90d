"""From folders of results to everything under ``reports/``."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from pipeline.formats.benchmarks import read_benchmarks
from pipeline.reporting.charts import headlines
from pipeline.reporting.claims import UNWEIGHED, make_findings, weigh_sources
from pipeline.reporting.clouds import choose_examples
from pipeline.reporting.difficulty import measure_difficulty
from pipeline.reporting.documents import render_latex, render_markdown
from pipeline.reporting.numbers import make_numbers, spread_over_draws, write_numbers
from pipeline.reporting.page import Contents, render_page
from pipeline.reporting.paper import place, scenario_rank
from pipeline.reporting.pictures import draw_pictures
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.reading import (
    PairFile,
    read_all_verdicts,
    read_all_walks,
    read_answers,
    read_pair_files,
    read_shipped,
    read_times,
    read_trainings,
)
from pipeline.reporting.tables import make_tables, make_trust
from pipeline.settings.params import SHOWN, shown_scenario

BOOTSTRAP_SEED = 0


@dataclass(frozen=True)
class Report:
    """The files under ``reports/``, not yet written."""

    tables: dict[str, str]
    """By file name."""
    pictures: dict[str, bytes]
    """By file name."""
    summary: dict[str, dict[str, float]]
    """Mean ERROR(R) in degrees of ``cf`` and ``cb``, by scenario."""
    page: str


def make_report(contents: Contents) -> Report:
    """Render what was read and computed: the same contents, the same bytes."""
    return Report(
        tables={
            "results.csv": write_numbers(contents.numbers),
            "results.md": render_markdown(
                contents.tables,
                contents.banner,
                contents.findings,
                contents.trust,
                contents.sources,
            ),
            "results.tex": render_latex(contents.tables, contents.banner),
        },
        pictures=dict(contents.pictures),
        summary=summarise(contents.numbers),
        page=render_page(contents),
    )


def make_contents(
    results: Path, models: Path, pairs: Path, benchmarks: Path, *, profile: str,
    provenance: Provenance | None = None,
) -> Contents:  # fmt: skip
    """Read the folders and compute, once, everything that is shown.

    Args:
        results: Folder of ``<method>/<scenario>.csv``, ``ablations/<name>.csv``,
            ``times/<method>.csv`` and ``walks/<scenario>/<method>.csv``; only the first are a must.
        models: Folder that has, at any depth, a ``facts.json`` for each training, and beside it
            its ``curve.csv``.
        pairs: Folder of the pair files ``<scenario>.h5``.
        benchmarks: Folder of what `make bench` measured; may hold nothing.
        profile: Name of the profile the numbers were made with.
        provenance: For the page; of the code and of what these folders hold.

    Raises:
        FileNotFoundError: There are no results, or no pair file for some of them.
        ValueError: A file is cut short or ill-formed.
    """
    walks, times, verdicts = (
        read_all_walks(results),
        read_times(results),
        read_all_verdicts(results),
    )
    answers = read_answers(results, verdicts)
    files = read_pair_files(pairs, [*answers["scenario"].unique(), *walks])
    trainings = [*read_trainings(models), *read_shipped(results)]
    examples = choose_examples(answers, files)
    numbers = make_numbers(answers, times, measure_difficulty(files), seed=BOOTSTRAP_SEED)
    everything = pd.concat([numbers, spread_over_draws(numbers)], ignore_index=True)
    return Contents(
        numbers=numbers,
        answers=answers,
        tables=make_tables(everything, trainings, files),
        trust=make_trust(numbers),
        sources=weigh_sources(numbers),
        verdicts=verdicts,
        examples=examples,
        pictures=draw_pictures(examples),
        trainings=trainings,
        files=files,
        profile=profile,
        banner=banner(profile, files.values()),
        findings=[] if profile in UNWEIGHED else make_findings(everything),
        walks=walks,
        provenance=provenance,
        benchmarks=read_benchmarks(benchmarks),
    )


def summarise(numbers: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Pick the mean ERROR(R) [deg] of CF and CB on each scenario, to four digits."""
    main = headlines(numbers, "error_r_deg").set_index(["method", "scenario"])["value"]
    return {
        name: {
            shown_scenario(scenario): float(f"{value:.4g}")
            for (whose, scenario), value in main.items()
            if whose == method
        }
        for method, name in SHOWN.items()
    }


def banner(profile: str, files: Iterable[PairFile]) -> str | None:
    """Say what keeps these numbers from being a reproduction; None if nothing does."""
    recorded = {file.scenario: file.source in ("local", "download") for file in files}
    synthetic = sorted((name for name, real in recorded.items() if not real), key=scenario_rank)
    if profile == "paper" and not synthetic:
        return None
    said = f"{profile} profile: not a reproduction"
    if not synthetic:
        return said
    everything = len(synthetic) == len(recorded)
    titles = "all of it" if everything else "; ".join(place(name).title for name in synthetic)
    return f"{said} (synthetic data: {titles})"
