"""DVC stage ``report``: results, curves and pairs -> everything under ``reports/``."""

import argparse
from pathlib import Path

from pipeline.artifacts import write_atomically
from pipeline.report import make_report


def main(argv: list[str] | None = None) -> None:
    """Read the folders, make the report, write its files."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("results", "models", "pairs", "table", "markdown", "page", "figures", "summary"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--profile", required=True)
    args = parser.parse_args(argv)

    report = make_report(args.results, args.models, args.pairs, profile=args.profile)

    write_atomically(args.table, report.table.encode())
    write_atomically(args.markdown, report.markdown.encode())
    write_atomically(args.summary, report.summary.encode())
    write_atomically(args.page, report.page.encode())
    for name, picture in report.pictures.items():
        write_atomically(args.figures / name, picture)


if __name__ == "__main__":
    main()
