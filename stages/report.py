"""DVC stage ``report``: results, curves, pairs and benchmarks -> everything under ``reports/``."""

import argparse
import sys
from pathlib import Path

from pipeline.formats.files import write_atomically, write_json
from pipeline.reporting.provenance import read_provenance
from pipeline.reporting.report import make_contents, make_report
from pipeline.settings.params import read_params
from pipeline.tracking.journal import journal
from pipeline.tracking.mlflow_sync import sync_after_report


def main(argv: list[str] | None = None) -> None:
    """Read the folders, make the report, write its files, and bring MLflow up to date."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("results", "models", "pairs", "benchmarks"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    for name in ("tables", "figures", "summary", "page"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    with journal(params={"profile": params.profile}) as notes:
        folders = args.results, args.models, args.pairs, args.benchmarks
        provenance = read_provenance(Path.cwd())
        contents = make_contents(*folders, profile=params.profile, provenance=provenance)
        report = make_report(contents)
        for name, table in report.tables.items():
            write_atomically(args.tables / name, table.encode())
        for name, picture in report.pictures.items():
            write_atomically(args.figures / name, picture)
        write_json(args.summary, report.summary)
        write_atomically(args.page, report.page.encode())
        for method, errors in report.summary.items():
            notes.metrics({f"{method}.{scenario}": error for scenario, error in errors.items()})
        for path in (args.tables, args.figures, args.page):
            notes.artifact(path)
    sys.stderr.write(f"{sync_after_report().sentence()}\n")
