"""DVC stage ``report``: results, curves, pairs and benchmarks -> everything under ``reports/``."""

import argparse
import sys
from pathlib import Path

from pipeline.artifacts import write_atomically
from pipeline.mlflow_sync import sync_after_report
from pipeline.params import read_params
from pipeline.reporting.provenance import read_provenance
from pipeline.reporting.report import make_report
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read the folders, make the report, write its files, and bring MLflow up to date."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("results", "models", "pairs", "benchmarks"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    for name in ("table", "markdown", "latex", "page", "figures", "summary"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    with journal(params={"profile": params.profile}) as notes:
        report = make_report(
            args.results,
            args.models,
            args.pairs,
            args.benchmarks,
            profile=params.profile,
            provenance=read_provenance(Path.cwd()),
        )
        write_atomically(args.table, report.table.encode())
        write_atomically(args.markdown, report.markdown.encode())
        write_atomically(args.latex, report.latex.encode())
        write_atomically(args.summary, report.summary.encode())
        write_atomically(args.page, report.page.encode())
        for name, picture in report.pictures.items():
            write_atomically(args.figures / name, picture)
        notes.metrics(report.headline)
        for path in (args.table, args.markdown, args.latex, args.page, args.figures):
            notes.artifact(path)
    sys.stderr.write(f"{sync_after_report().sentence()}\n")


if __name__ == "__main__":
    run(main)
