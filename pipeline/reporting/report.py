"""From folders of results to everything under ``reports/``."""

import json
from dataclasses import dataclass
from pathlib import Path

from pipeline.benchmark_files import read_benchmarks
from pipeline.reporting.background import read_pair_facts, read_trainings
from pipeline.reporting.difficulty import read_difficulties
from pipeline.reporting.findings import make_findings
from pipeline.reporting.latex import render_latex
from pipeline.reporting.markdown import render_markdown
from pipeline.reporting.overlays import read_overlays, read_walked_pairs
from pipeline.reporting.page import Contents, render_page
from pipeline.reporting.pictures import draw_all
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.result_files import WALKS, read_results, read_times
from pipeline.reporting.tables import format_rows, make_rows
from pipeline.reporting.views import banner, make_tables, summarise
from pipeline.walks import Walk, read_walks

BOOTSTRAP_SEED = 0


@dataclass(frozen=True)
class Report:
    """The files under ``reports/``, not yet written."""

    table: str
    markdown: str
    latex: str
    page: str
    summary: str
    pictures: dict[str, bytes]
    """By file name."""

    @property
    def headline(self) -> dict[str, float]:
        """The summary's numbers by ``<scenario>.<method>.error_r_deg``."""
        errors = json.loads(self.summary)["error_r_deg"]
        return {
            f"{scenario}.{method}.error_r_deg": value
            for scenario, methods in errors.items()
            for method, value in methods.items()
        }


def make_report(
    results: Path,
    models: Path,
    pairs: Path,
    benchmarks: Path,
    *,
    profile: str,
    provenance: Provenance | None = None,
) -> Report:
    """Compute all numbers once and render them: the same inputs, the same bytes.

    Args:
        results: Folder of ``<scenario>/<method>.csv``, ``ablations/<name>.csv``,
            ``times/<method>.csv`` and ``walks/<scenario>/<method>.csv``; only the first are a must.
        models: Folder of ``<scenario>/<method>.json`` with a curve ``.csv`` beside each, and of
            the same under ``ablations/<name>``.
        pairs: Folder of the pair files ``<scenario>.h5``.
        benchmarks: Folder of what `make bench` measured; may hold nothing.
        profile: Name of the profile the numbers were made with.
        provenance: For the page; of the code and of what these folders hold.

    Raises:
        FileNotFoundError: There are no results, or no pair file for some of them.
        ValueError: A file is cut short or ill-formed.
    """
    scores = read_results(results)
    scenarios = {one.scenario for one in scores}
    trainings = read_trainings(models)
    facts = {name: read_pair_facts(pairs, name) for name in scenarios}
    difficulties = read_difficulties(pairs, scenarios)
    rows = make_rows(scores, read_times(results), difficulties, seed=BOOTSTRAP_SEED)
    tables = make_tables(rows, trainings, facts)
    findings = make_findings(rows)
    overlays, walks = read_overlays(scores, pairs), read_all_walks(results)
    warning = banner(profile, facts.values())
    contents = Contents(
        rows, tables, overlays, trainings, facts, profile, warning,
        findings=findings,
        walks=walks,
        walked=read_walked_pairs(walks, pairs),
        scores=scores,
        provenance=provenance,
        benchmarks=read_benchmarks(benchmarks),
    )  # fmt: skip
    return Report(
        table=format_rows(rows),
        markdown=render_markdown(tables, facts, warning, findings),
        latex=render_latex(tables, facts, warning),
        page=render_page(contents),
        summary=json.dumps(summarise(rows, profile), indent=2, sort_keys=True) + "\n",
        pictures=draw_all(rows, overlays, trainings, scores),
    )


def read_all_walks(results: Path) -> dict[str, list[Walk]]:
    """Read every ``walks/<scenario>/<method>.csv``, by scenario; none is fine.

    Raises:
        ValueError: One is cut short or ill-formed.
    """
    walks: dict[str, list[Walk]] = {}
    for file in sorted(results.glob(f"{WALKS}/*/*.csv")):
        walks.setdefault(file.parent.name, []).extend(read_walks(file))
    return walks
