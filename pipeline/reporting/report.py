"""From folders of results to everything under ``reports/``."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.formats.benchmarks import read_benchmarks
from pipeline.formats.walks import Walk, read_walks
from pipeline.reporting.background import read_pair_files, read_trainings
from pipeline.reporting.difficulty import measure_difficulties
from pipeline.reporting.findings import UNWEIGHED, make_findings
from pipeline.reporting.latex import render_latex
from pipeline.reporting.markdown import render_markdown
from pipeline.reporting.overlays import make_overlays, pick_walked_pairs
from pipeline.reporting.page import Contents, render_page
from pipeline.reporting.pictures import draw_all
from pipeline.reporting.provenance import Provenance
from pipeline.reporting.result_files import WALKS, read_results, read_times
from pipeline.reporting.tables import format_rows, make_rows
from pipeline.reporting.views import banner, make_tables, summarise

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
    scores, walks = read_results(results), read_all_walks(results)
    files = read_pair_files(pairs, [*(one.scenario for one in scores), *walks])
    facts = {name: file.facts for name, file in files.items()}
    trainings, overlays = read_trainings(models), make_overlays(scores, files)
    rows = make_rows(scores, read_times(results), measure_difficulties(files), seed=BOOTSTRAP_SEED)
    tables, warning = make_tables(rows, trainings, facts), banner(profile, facts.values())
    findings = [] if profile in UNWEIGHED else make_findings(rows)
    contents = Contents(
        rows, tables, overlays, trainings, facts, profile, warning,
        findings=findings,
        walks=walks,
        walked=pick_walked_pairs(walks, files),
        scores=scores,
        provenance=provenance,
        benchmarks=read_benchmarks(benchmarks),
    )  # fmt: skip
    return Report(
        tables={
            "results.csv": format_rows(rows),
            "results.md": render_markdown(tables, facts, warning, findings),
            "results.tex": render_latex(tables, facts, warning),
        },
        pictures=draw_all(rows, overlays, trainings, scores),
        summary=summarise(rows),
        page=render_page(contents),
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
